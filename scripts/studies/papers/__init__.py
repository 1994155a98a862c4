"""The numbers and curves of three papers, computed again and compared; see scripts/reproduce_papers.py."""
