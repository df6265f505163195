"""The same pulses identified by each method of the thesis, by lmfit and by ours, side by side.

Of a finished campaign: `lab/tools/compare_methods.py`.
"""
