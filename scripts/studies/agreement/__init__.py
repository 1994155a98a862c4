"""Models of one robot against a Kirchhoff rod: tip error over the number of segments; see scripts/agreement.py."""
