"""What nobody could do better on a record: the clairvoyant optimum."""
