"""RAO files of other programs and our own, each read into one convention."""
