"""The page that solves: the drawing of a robot as data, the text of the page, and its scripts."""
