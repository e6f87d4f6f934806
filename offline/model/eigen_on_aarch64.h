#pragma once

// For every source with Eigen on aarch64, before any header: Eigen 3.4 multiplies and adds there in
// one instruction, which rounds once, and in matrix products takes other rows together than on
// x86-64, whose sums go through the same numbers in another order. With this it computes as on
// x86-64 with SSE2, to the last bit.

#include <arm_neon.h>

#undef __ARM_FEATURE_FMA
#define vfmaq_n_f64(c, a, b) vaddq_f64(c, vmulq_n_f64(a, b))
#define vfmaq_laneq_f64(c, a, b, lane) vaddq_f64(c, vmulq_laneq_f64(a, b, lane))

// Eigen includes this between its vectors and its matrix products.
#define EIGEN_MATRIXBASE_PLUGIN "offline/model/eigen_products_on_aarch64.h"
