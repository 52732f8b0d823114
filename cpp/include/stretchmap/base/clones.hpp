// STRETCHMAP_CLONES before a function compiles it for several generations of processors; the one
// to run is chosen when the library is loaded. Loops over lanes in it are vectorized accordingly.
// Its file has to be compiled without contraction, so that all of them give the same bits.
#pragma once

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define STRETCHMAP_CLONES_CHOSEN  // and functions of one name for several targets are, too
#define STRETCHMAP_CLONES \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define STRETCHMAP_CLONES
#endif

#if defined(__GNUC__)
#define STRETCHMAP_INLINE inline __attribute__((always_inline))
#else
#define STRETCHMAP_INLINE inline
#endif
