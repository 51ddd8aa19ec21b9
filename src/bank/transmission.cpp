#include "transmission.hpp"

#include <cmath>

namespace engine {

static void count_transmissions(int64_t b, const BankTables& bank) {
    int64_t& count = bank.ringing[b].transmissions = 0;
    for (int64_t j = 0; j < bank.transmissions.shape[1]; ++j) count += bank.transmissions(b, j).phase != phase::OFF;
}

void end_transmissions(int64_t b, const BankTables& bank) {
    const bool active = is_active(bank.ringing[b]);
    for (int64_t j = 0; j < bank.transmissions.shape[1]; ++j) {
        int64_t& now = bank.transmissions(b, j).phase;
        switch (active ? now : int64_t{phase::OFF}) {
            case phase::STEADY: now = phase::LEAVING; break;
            case phase::RISING: now = phase::BRIEF; break;
            case phase::OFF:
            case phase::COMING: now = phase::OFF; break;
            default: break;  // it ends already
        }
    }
    count_transmissions(b, bank);
}

bool begin_transmission(int64_t b, int64_t to, Array<const Complex, 2> weight, const BankTables& bank) {
    const int64_t sets = bank.observed.shape[0], start = bank.body[b].start, modes = bank.law.shape[1];
    int64_t j = 0;
    while (j < bank.transmissions.shape[1] && bank.transmissions(b, j).phase != phase::OFF) ++j;
    if (j == bank.transmissions.shape[1]) return false;
    bank.transmissions(b, j) = {to, is_active(bank.ringing[b]) ? phase::COMING : phase::STEADY};
    for (int64_t w = 0; w < sets; ++w) {
        double* row = bank.transmission_weight[j * sets + w].data + start;
        for (int64_t k = 0; k < bank.body[b].columns; ++k) row[k] = weight(w, k).re, row[modes + k] = weight(w, k).im;
    }
    count_transmissions(b, bank);
    return true;
}

void move_transmissions_on(int64_t b, const BankTables& bank) {
    int64_t left = 0;
    const int64_t partners = bank.ringing[b].transmissions ? bank.transmissions.shape[1] : 0;
    for (int64_t j = 0; j < partners; ++j) {
        int64_t& now = bank.transmissions(b, j).phase;
        switch (now) {
            case phase::COMING: now = phase::RISING; break;
            case phase::RISING: now = phase::STEADY; break;
            case phase::LEAVING:
            case phase::BRIEF: now = phase::FALLING; break;
            case phase::FALLING: now = phase::OFF; break;
            default: break;  // off, or steady
        }
        left += now != phase::OFF;
    }
    bank.ringing[b].transmissions = left;
}

int64_t last_weight_set(int64_t b, const BankTables& bank) {
    int64_t last = 0;
    const int64_t sets = bank.observed.shape[0];
    for (int64_t w = 0; w < sets; ++w)
        if (bank.observed(w, b)) last = w;
    if (bank.ringing[b].transmissions)
        for (int64_t j = 0; j < bank.transmissions.shape[1]; ++j)
            if (is_active(bank.transmissions(b, j))) last = (j + 2) * sets - 1;
    return last;
}

void transmit(int64_t b, int64_t j, int64_t w, const Stretch& stretch, const double* values, const BankTables& bank,
              Array<double, 3> transmitted) {
    const auto [to, now] = bank.transmissions(b, j);
    bank.ringing[to].passed_to = 1;
    const int64_t place = (stretch.at + stretch.i) & (BLOCK - 1);
    double* out = transmitted[w][to].data + stretch.i;
    const bool rises = now == phase::RISING || now == phase::BRIEF;
    for (int64_t k = 0; k < stretch.count; ++k) {
        const double x = static_cast<double>(place + k) / BLOCK;
        const double ramp = rises ? x : (now == phase::FALLING ? 1.0 - x : 1.0);
        out[k] += ramp * values[k];
    }
}

void add_transmitted(int64_t n, const BankTables& bank, const ScratchTables& scratch) {
    for (int64_t b = 0; b < bank.ringing.size(); ++b) {
        if (!bank.ringing[b].passed_to) continue;
        bank.ringing[b].passed_to = 0;
        scratch.sounds(b, 0) = 1;
        for (int64_t w = 0; w < bank.observed.shape[0]; ++w) {
            double *source = scratch.source[w][b].data, *transmitted = scratch.transmitted[w][b].data;
            for (int64_t k = 0; k < n; ++k) {
                const double value = source[k] + transmitted[k];
                source[k] = std::fabs(value) >= FLUSH ? value : 0.0;
                transmitted[k] = 0.0;
            }
        }
    }
}

}  // namespace engine
