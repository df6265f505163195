"""Simulated records compared with real ones: noise, clock, relaxation, pulses, peaks of dQ/dV.

The only part of the laboratory that uses the pipeline, and of it only what reads files and cuts
records into steps, so that real and simulated records are treated alike.
"""
