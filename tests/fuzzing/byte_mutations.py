"""Mutations of bytes: of binary chunks, images and whole files."""

import random


def mutate_bytes(content: bytes, rng: random.Random) -> bytes:
    """`content` cut, repeated, overwritten or lengthened in one to three places."""
    changed = bytearray(content)
    for _ in range(rng.randint(1, 3)):
        start = rng.randrange(len(changed) + 1)
        length = min(2 ** rng.randrange(10), len(changed) - start)
        match rng.randrange(7):
            case 0:
                del changed[start:]
            case 1:
                del changed[start : start + length]
            case 2:
                changed[start:start] = changed[start : start + length] * rng.choice((1, 2, 100))
            case 3:
                changed[start : start + length] = rng.randbytes(length)
            case 4:
                changed[start:start] = rng.randbytes(length)
            case 5:
                changed[start : start + length] = bytes([rng.choice((0, 1, 0x7F, 0x80, 0xFF))]) * length
            case _:
                for at in range(start, min(start + 1 + length // 16, len(changed))):
                    changed[at] ^= 1 << rng.randrange(8)
    return bytes(changed)
