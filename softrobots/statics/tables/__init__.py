"""Results of statics as tables."""
