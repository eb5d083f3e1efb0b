"""Benchmark and laboratory: the virtual city, the reproduction of the paper, reports, the demo."""
