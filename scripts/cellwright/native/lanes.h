/* What kernels share that take rows abreast: four lanes on every machine, so that every machine adds
 * in the same order, and a clone for wider registers where the compiler can choose at load time. */
#ifndef LANES_H
#define LANES_H
#include <stdint.h>

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
#define CLONES __attribute__((target_clones("avx2", "default")))
#else
#define CLONES
#endif

typedef double Lanes __attribute__((vector_size(32)));
typedef int64_t Bits __attribute__((vector_size(32)));

static const double INVERSE_FACTORIAL[14] = {
    1.0,           1.0,           1.0 / 2,        1.0 / 6,         1.0 / 24,
    1.0 / 120,     1.0 / 720,     1.0 / 5040,     1.0 / 40320,     1.0 / 362880,
    1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800};

/* 2^n and rest of exp(x) = 2^n · exp(rest), |x| <= 700: the last bits of a number too large for a
 * fraction are n. */
static inline __attribute__((always_inline)) void parted(const Lanes *x, Lanes *scale, Lanes *rest) {
    const double large = 6755399441055744.0; /* 1.5 · 2^52 */
    const Lanes whole = *x * 1.4426950408889634 + large, n = whole - large;
    *rest = *x - n * 0x1.62e42feep-1 - n * 0x1.a39ef35793c76p-33; /* n ln 2 */
    *scale = (Lanes)(((Bits)whole + 1023) << 52);
}

/* Sum of rest^(k - from) / k! over k from `from` to 13, to rounding for |rest| <= ln(2) / 2. */
static inline __attribute__((always_inline)) void series_from(int from, const Lanes *rest, Lanes *sum) {
    Lanes series = *rest * INVERSE_FACTORIAL[13] + INVERSE_FACTORIAL[12];
#pragma GCC unroll 12
    for (int k = 11; k >= from; k--) series = series * *rest + INVERSE_FACTORIAL[k];
    *sum = series;
}
#endif
