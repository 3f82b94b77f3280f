"""The plant: equations of winch, rope and payload, and the linear plants made of them."""
