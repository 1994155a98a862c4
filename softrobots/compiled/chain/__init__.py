"""The statics of a serial chain, element by element, as traced expressions."""
