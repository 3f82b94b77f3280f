"""The loop: responses, margins and what is measured on them."""
