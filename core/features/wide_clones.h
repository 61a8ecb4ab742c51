#pragma once

// A function so marked is compiled twice, and the processor takes the one with the wider registers that it
// has. Neither fuses a product and a sum: as long as each sum keeps its order, both give the same bits.
#if defined(__x86_64__) && defined(__GNUC__)
#define CAIRN_WIDE_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define CAIRN_WIDE_CLONES
#endif
