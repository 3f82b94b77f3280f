"""From a hull's panels to the motions of a vessel, by Capytaine."""
