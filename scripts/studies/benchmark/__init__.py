"""What the compiled solvers are measured against: baselines, the measurement, and its report; see scripts/benchmark.py."""
