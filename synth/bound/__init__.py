"""What no linear controller can do better than, and the best that was found."""
