"""Words, tables and numbers as people read them."""
