#include "translation.hpp"

#include <algorithm>
#include <cmath>

#include "../contact/pulse_shape.hpp"
#include "../math/elementary.hpp"
#include "drive.hpp"
#include "strike_pool.hpp"

namespace engine {

namespace {

int64_t floor_quotient(int64_t a, int64_t b) {  // b > 0
    return a >= 0 ? a / b : -((b - 1 - a) / b);
}

// Turn the impulses in rows 0, 2, 4 of axis_impulse (6, stride) into real and imaginary part of each axis.
void apply_onset(int64_t n, const double (&onset)[2], int64_t stride, double* axis_impulse) {
    for (int axis = 0; axis < 3; ++axis) {
        double *real = axis_impulse + 2 * axis * stride, *imaginary = real + stride;
        for (int64_t k = 0; k < n; ++k) {
            const double impulse = flushed(real[k]);
            real[k] = impulse * onset[0];
            imaginary[k] = impulse * onset[1];
        }
    }
}

// Add the cells of a strike that end by the samples at … at + n - 1. It is done after its last.
void add_cells(int64_t at, int64_t n, BankStrike& strike, int64_t stride, double* axis_impulse) {
    const int64_t cells = strike.cells;
    const double many = static_cast<double>(cells);
    const int64_t first = floor_quotient(strike.cell_first, cells) + 1;
    const int64_t last = floor_quotient(strike.cell_stop - 1, cells) + 1;
    const double (&turn)[2] = strike.cell_turn;
    const double (&onset)[2] = strike.cell_onset;
    const bool flat = strike.flat != 0;
    for (int64_t sample = std::max(first, at); sample < std::min(last + 1, at + n); ++sample) {
        double x = 0, y = 0;
        const int64_t cell = (sample - 1) * cells;
        double before = cumulated((static_cast<double>(cell) / many - strike.start) / strike.length, flat);
        for (int64_t i = 0; i < cells; ++i) {
            const double after =
                cumulated((static_cast<double>(cell + i + 1) / many - strike.start) / strike.length, flat);
            const double re = x * turn[0] - y * turn[1], im = x * turn[1] + y * turn[0];
            x = re + (after - before), y = im;
            before = after;
        }
        const double re = x * onset[0] - y * onset[1], im = x * onset[1] + y * onset[0];
        for (int axis = 0; axis < 3; ++axis) {
            axis_impulse[2 * axis * stride + sample - at] += strike.rigid_impulse_n_s[axis] * re;
            axis_impulse[(2 * axis + 1) * stride + sample - at] += strike.rigid_impulse_n_s[axis] * im;
        }
    }
    if (last < at + n) strike.rigid = 0;
}

// Run the recursion on all axes, side by side, through the samples at … at + n - 1 into dipole (3, n or more). Returns
// whether one moves.
bool run_axes(int64_t at, int64_t n, const BankBody& body, int64_t stride, const double* axis_impulse,
              double (&motion)[3][2], Array<double, 2> dipole) {
    constexpr double floor = FLOOR * FLOOR;
    const double p_re = body.rigid_pole[0], p_im = body.rigid_pole[1], weight = body.rigid_weight;
    double x[3], y[3];
    for (int axis = 0; axis < 3; ++axis) x[axis] = motion[axis][0], y[axis] = motion[axis][1];
    for (int64_t k = 0; k < n;) {
        const int64_t place = (at + k) & (DRIVEN - 1);
        for (int axis = 0; axis < 3; ++axis)
            if (place == 0 && x[axis] * x[axis] + y[axis] * y[axis] < floor) x[axis] = y[axis] = 0;
        const int64_t end = std::min(n, k + DRIVEN - place);
        for (; k < end; ++k)
            for (int axis = 0; axis < 3; ++axis) {
                const double real = axis_impulse[2 * axis * stride + k];
                const double imaginary = axis_impulse[(2 * axis + 1) * stride + k];
                const double re = x[axis] * p_re + (real - y[axis] * p_im);
                y[axis] = y[axis] * p_re + (imaginary + x[axis] * p_im);
                x[axis] = re;
                const double value = re * weight;
                dipole(axis, k) = flushed(value);
            }
    }
    bool moves = false;
    for (int axis = 0; axis < 3; ++axis) {
        motion[axis][0] = x[axis], motion[axis][1] = y[axis];
        moves = moves || x[axis] != 0 || y[axis] != 0;
    }
    return moves;
}

}  // namespace

void enter_cells(BankStrike& strike, const BankBody& body) {
    // of a pulse per 1/w of a rigid body: a third of (w·cell)³ = 0.5 % is the error allowed in its level
    constexpr double cells_per_radian = 4.0;
    constexpr double most_cells = 4096.0;  // a sample: a pulse shorter than one is even over it
    const double s_re = body.rigid_log_pole[0], s_im = body.rigid_log_pole[1];
    const double least = std::ceil(cells_per_radian * -s_re);
    const double cells = std::max(least, std::ceil(std::min(NODES_PER_PULSE / strike.length, most_cells)));
    strike.cells = static_cast<int64_t>(cells);
    strike.cell_first = static_cast<int64_t>(std::floor(strike.start * cells));
    strike.cell_stop = static_cast<int64_t>(std::ceil((strike.start + strike.length) * cells));
    const double x = s_re / cells, y = s_im / cells, half = sin(0.5 * y);
    const double re = expm1(x) * cos(y) - 2.0 * (half * half), im = exp(x) * sin(y);  // e^{s/cells} - 1
    const double q = body.rigid_quadrature;
    const double a = re - q * im, b = im + q * re, size = x * x + y * y;
    strike.cell_turn[0] = 1.0 + re, strike.cell_turn[1] = im;
    strike.cell_onset[0] = (a * x + b * y) / size, strike.cell_onset[1] = (b * x - a * y) / size;
}

bool translate(int64_t at, int64_t n, int64_t b, int64_t stride, const BankTables& bank, const ScratchTables& scratch,
               BankWork& work) {
    Ringing& ringing = bank.ringing[b];
    bool struck = false;
    for (int64_t slot = ringing.strike; slot >= 0; slot = bank.strikes[slot].next)
        struck = struck || (bank.strikes[slot].rigid && bank.strikes[slot].start < static_cast<double>(at + n));
    const BodyForces forces{work.side.data(), work.first[b], work.first[b + 1], work.signal.data(), stride};
    if (!(struck || forces.stop > forces.first || ringing.moving)) return false;
    double* axis_impulse = work.axis_impulse.data();
    drive().sum_forces(axis_impulse, forces, scratch.direction0.data, scratch.direction1.data, n);
    apply_onset(n, bank.body[b].rigid_onset, stride, axis_impulse);
    if (struck)
        for (int64_t slot = ringing.strike; slot >= 0; slot = bank.strikes[slot].next)
            if (bank.strikes[slot].rigid) add_cells(at, n, bank.strikes[slot], stride, axis_impulse);
    const bool moves = run_axes(at, n, bank.body[b], stride, axis_impulse, ringing.motion, scratch.dipole[b]);
    ringing.moving = moves ? 1 : 0;
    return true;
}

}  // namespace engine
