"""What several studies use: records of runs in the documentation, Markdown, copies of the checkout, the code of the tests."""
