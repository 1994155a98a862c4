"""The numbers and curves of the three papers behind this package, computed again and compared.

`reproduction.reproduce()` gives the rows of every paper, `rendering` makes tables of them, `pictures` draws the figures, and
`curves` writes their data. `scripts/reproduce_papers.py` does all of it.
"""
