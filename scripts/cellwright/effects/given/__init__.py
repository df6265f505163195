"""Bases of the search whose voltage is given: the model in use, and any other simulator."""
