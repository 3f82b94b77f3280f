"""What keeps results: the journal, the pool of processes, the digest of the code."""
