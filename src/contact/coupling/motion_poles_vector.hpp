// Loops of `motion_poles` over the motions of a body, as vector instructions: each motion for itself, so that the bits
// are the same at every level.
#pragma once

#include <cstdint>

#include "../../vector_level.hpp"

namespace engine {

// Response of one mode of a partner to m motions: compliance (y + iz), motion u + iv.
struct PartnerResponse {
    double* u;
    double* v;
    double* y;
    double* z;
};

// Factors of sums of rows: of row i in sum j, first[i·row + j·sum].
struct RowFactors {
    const double* first;
    int64_t row, sum;
};

struct MotionLoops {
    // sums (many, n): Σ_i factor·rows[i] of ``count`` rows (n,), one behind the other, in their order.
    void (*combine)(const RowFactors& factors, int64_t many, int64_t count, const double* rows, int64_t n,
                    double* sums);
    // A partner's mode with λ and 2d: 1/(λ + 2ds + s²) at ω (n,) and ω² (n,), times force along it; slope += motion².
    void (*respond)(double lam, double loss, const double* along, const double* rate, const double* square, int64_t n,
                    const PartnerResponse& response, double* slope_re, double* slope_im);
    // held -= (x + iy)² / (ω_n² − ω_k²), bounded where two frequencies are near; own (n,): ω_k².
    void (*hold)(double value, const double* own, const double* x, const double* y, int64_t n, double* held_re,
                 double* held_im);
    // held += spring·(u + iv)².
    void (*add_square)(double spring, const double* u, const double* v, int64_t n, double* held_re, double* held_im);
    // Divide the motion of a partner's mode by 1 + shift·compliance and multiply it by part (real and imaginary parts
    // n apart), 0 where it is not moved; size += |motion|².
    void (*share)(const bool* moves, const double* part, const double* shift, int64_t n,
                  const PartnerResponse& response, double* size);
};
CHOOSE_VECTOR(MotionLoops, motion_loops)

}  // namespace engine
