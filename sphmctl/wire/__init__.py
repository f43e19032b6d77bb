"""Sans-I/O codecs of the two protocols: bytes in, values out, and back."""
