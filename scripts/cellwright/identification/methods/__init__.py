"""Identification of one pulse record by each method of the thesis, lmfit and ours."""
