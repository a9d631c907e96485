/// Loops over many numbers use the wide vectors of processors that have them.
#pragma once

#include <cstddef>  // defines __GLIBC__

/// Before a function: it is compiled twice, once for processors with AVX2, and the program takes that one where the processor has it. What
/// the function calls in its loops must be defined in the same file or in a header: it becomes a part of the function. The results are the
/// same, bit for bit: no operations are reordered or contracted. Sanitizers do not know how a function is chosen before the program
/// starts, nor does the C library musl.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define WIDE_VECTORS __attribute__((target_clones("avx2", "default"), flatten))
#else
#define WIDE_VECTORS
#endif
