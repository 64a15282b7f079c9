"""The reference: one module per page, each with a function that makes the page from the code it describes."""
