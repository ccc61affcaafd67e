// Pseudorandom numbers from integers.
//
// Provides: `hashed`, `unit_number`. Twin: `hashed` in tuner/reference/sobol.py.

// Wellons' lowbias32.
uint hashed(uint x) {
    x = (x ^ (x >> 16)) * 0x21F0AAADu;
    x = (x ^ (x >> 15)) * 0xD35A2D97u;
    return x ^ (x >> 15);
}

// In [0, 1). 24 bits fill the mantissa; with more, the largest would round up to 1.
float unit_number(uint bits) {
    return float(bits >> 8) * (1.0 / 16777216.0);
}
