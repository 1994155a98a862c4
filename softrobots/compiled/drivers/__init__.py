"""The loops around the traced functions: Newton's method, energy descent, searches, batches; as text of the kernel language."""
