/*
 * Intrinsics of the kernel language in freestanding C99: no libm, no tables.
 *
 * Functions stand apart by one empty line, in the order in which a generated file needs them; the names there have the prefix
 * of that file in place of PREFIX_.
 */

/* a where the condition holds, else b; both have been evaluated. */
static double PREFIX_where(int condition, double a, double b)
{
    return condition ? a : b;
}

/* x without its sign. */
static double PREFIX_fabs(double x)
{
    return x <= 0.0 ? 0.0 - x : x;
}

/* The largest whole number not above x. From 2^52 on all numbers are whole; infinities and NaN stay. */
static double PREFIX_floor(double x)
{
    double whole;
    if (!(x > -4503599627370496.0 && x < 4503599627370496.0)) {
        return x;
    }
    whole = (double)(int64_t)x;
    return whole > x ? whole - 1.0 : whole;
}

/*
 * The square root of x, correctly rounded; NaN for x < 0.
 *
 * x = m 4^e with 1 <= m < 4. Four steps of Heron's method bring the root of m to one unit in the last place. The last
 * unit is decided in integers: with y in units of 2^-52 and m in units of 2^-104, the root is nearer to y + 1 than to y
 * if m - y^2 > y, and nearer to y - 1 if m - y^2 <= -y. The differences are small, so that they are right modulo 2^64.
 */
static double PREFIX_sqrt(double x)
{
    union {
        double number;
        uint64_t bits;
    } pattern;
    uint64_t mantissa, root, rest;
    int exponent = -512;
    double m, y;
    if (!(x > 0.0 && x <= DBL_MAX)) {
        return x < 0.0 ? (x - x) / (x - x) : x; /* 0, infinity and NaN are their own roots */
    }
    if (x < DBL_MIN) {
        x *= 18014398509481984.0; /* 4^27 */
        exponent -= 27;
    }
    pattern.number = x;
    exponent += (int)(((pattern.bits >> 52) + 1U) >> 1);
    mantissa = (pattern.bits & 0xFFFFFFFFFFFFFU) | 0x10000000000000U;
    mantissa <<= ~(pattern.bits >> 52) & 1U; /* an odd power of two has an even biased exponent */
    m = (double)mantissa * DBL_EPSILON;
    y = 0.8346 + 0.2951 * m;
    y = 0.5 * (y + m / y);
    y = 0.5 * (y + m / y);
    y = 0.5 * (y + m / y);
    y = 0.5 * (y + m / y);
    root = (uint64_t)(y * 4503599627370496.0);
    rest = (mantissa << 52) - root * root;
    if (rest - root - 1U < 0x8000000000000000U) {
        root += 1U;
    } else if (0U - rest - root < 0x8000000000000000U) {
        root -= 1U;
    }
    pattern.bits = root + ((uint64_t)(exponent + 1022) << 52);
    return pattern.number;
}
