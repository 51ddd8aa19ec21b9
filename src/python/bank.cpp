// Python's door to src/bank.
#include "../bank/bank.hpp"

#include "../bank/poles.hpp"
#include "../bank/rigid_motion.hpp"
#include "../bank/strike_pool.hpp"
#include "../bank/transmission.hpp"
#include "arrays.hpp"

namespace engine {

constexpr int64_t LATEST = int64_t{1} << 52;  // sample: from there on, times in samples have no fractions

static void check_number(const char* name, double value, double least, double most) {
    if (!(value >= least && value <= most))
        throw nb::value_error((std::string(name) + ": " + std::to_string(value) + " is not in " +
                               std::to_string(least) + " … " + std::to_string(most))
                                  .c_str());
}

// Check that a strike under way is one that the bank can have made: what it adds at a sample has room.
static void check_strike(const BankStrike& strike) {
    check_number("start of a strike", strike.start, -LATEST, LATEST);
    check_number("length of a strike", strike.length, SHORTEST_PULSE, LATEST);
    if (strike.modal) {
        check_range("count of a strike", strike.count, 1, LATEST);
        check_range("upcoming node of a strike", strike.upcoming, 0, strike.count + 1);
        check_range("first sample of a strike", strike.first, -LATEST, LATEST);
        check_range("nodes a sample of a strike", strike.whole, 1, LATEST);
        check_range("first nodes of a strike", strike.within, 0, strike.count + 1);
        check_number("spacing of a strike", strike.spacing, SHORTEST_PULSE / NODES_PER_PULSE, 1);
        check_number("phase of a strike", strike.phase, -1, 2);
        const int64_t most = strike.within + (DRIVEN - 1) * std::min(strike.whole + 1, MOST_DUE);
        check_range("nodes of a strike", std::min(strike.count - strike.upcoming, most), 0, MOST_DUE + 1);
    }
    if (strike.rigid) {
        check_range("cells of a strike", strike.cells, 1, int64_t{1} << 31);
        check_range("first cell of a strike", strike.cell_first, -LATEST, LATEST);
        check_range("cells of a strike", strike.cell_stop, strike.cell_first, LATEST);
    }
}

// Check that all tables of a bank are of one size, and that what its rows name is there.
static void check_bank(const BankTables& bank) {
    const int64_t bodies = bank.body.size(), modes = bank.law.shape[1], sets = bank.weight.shape[0];
    const int64_t partners = bank.transmissions.shape[1], aimed = bank.turned.shape[0], pool = bank.strikes.size();
    check_shape("weight", bank.weight, sets, 2 * modes);
    check_shape("observed", bank.observed, sets, bodies);
    check_shape("aims", bank.aims, sets);
    check_shape("radiates", bank.radiates, sets);
    check_shape("ringing", bank.ringing, bodies);
    check_shape("law", bank.law, 7, modes);
    for (const auto& [name, values] :
         {std::pair{"z", bank.z}, {"driven", bank.driven}, {"pole", bank.pole}, {"block", bank.block}})
        check_shape(name, values, 2 * modes);
    check_shape("sound", bank.sound, sets, bodies, BLOCK);
    check_shape("coming", bank.coming, 8, modes);
    check_shape("transmissions", bank.transmissions, bodies, partners);
    check_shape("transmission_weight", bank.transmission_weight, partners * sets, 2 * modes);
    check_shape("transmission_sound", bank.transmission_sound, partners * sets, bodies, BLOCK);
    check_shape("aim", bank.aim, 2 * aimed, 2 * modes);
    check_shape("turned", bank.turned, aimed, bodies);
    check_shape("blend", bank.blend, aimed, BLOCK);
    check_shape("rows", bank.rows, pool, 10, bank.rows.shape[2]);
    check_shape("free", bank.free, pool + 1);
    check_range("free", bank.free[0], 0, pool + 1);
    for (int64_t i = 1; i <= bank.free[0]; ++i) check_range("free", bank.free[i], 0, pool);
    for (int64_t w = 0; w < sets; ++w) check_range("aims", bank.aims[w], -1, aimed);
    for (int64_t b = 0; b < bodies; ++b) {
        const BankBody& body = bank.body[b];
        const int64_t lanes = body.stop - body.start;
        check_range("start", body.start, 0, modes + 1);
        check_range("stop", body.stop, body.start, modes + 1);
        check_range("columns", body.columns, 0, lanes + 1);
        if (lanes % LANE_PAIR) throw nb::value_error("a body's lanes are not whole groups");
        if (pool && lanes > bank.rows.shape[2]) throw nb::value_error("rows: too few columns");
        int64_t linked = 0;
        for (int64_t slot = bank.ringing[b].strike; slot >= 0; slot = bank.strikes[slot].next) {
            check_range("strike", slot, 0, pool);
            check_range("strikes of a body", ++linked, 0, pool + 1);  // no ring of them
            check_strike(bank.strikes[slot]);
        }
        for (int64_t j = 0; j < partners; ++j)
            if (bank.transmissions(b, j).phase != phase::OFF) {
                check_range("phase", bank.transmissions(b, j).phase, phase::OFF, phase::BRIEF + 1);
                check_range("to", bank.transmissions(b, j).to, 0, bodies);
            }
    }
}

// Check that a step's tables fit a bank and n samples.
static void check_scratch(const ScratchTables& scratch, const BankTables& bank, int64_t n) {
    const int64_t bodies = bank.body.size(), sets = bank.weight.shape[0];
    const int64_t drives = scratch.count[1], columns = scratch.gain0.shape[2];
    check_range("count", drives, 0, scratch.body.shape[0] + 1);
    check_range("count", drives, 0, std::min(scratch.gain0.shape[0], scratch.gain1.shape[0]) + 1);
    check_range("count", drives, 0, std::min(scratch.direction0.shape[0], scratch.direction1.shape[0]) + 1);
    check_range("force", drives * n, 0, scratch.force.size() + 1);
    check_shape("gain0", scratch.gain0, scratch.gain0.shape[0], 2, columns);
    check_shape("gain1", scratch.gain1, scratch.gain1.shape[0], 2, columns);
    check_shape("direction0", scratch.direction0, scratch.direction0.shape[0], 3);
    check_shape("direction1", scratch.direction1, scratch.direction1.shape[0], 3);
    check_shape("body", scratch.body, scratch.body.shape[0], 2);
    check_shape("sounds", scratch.sounds, bodies, 2);
    check_shape("source", scratch.source, sets, bodies, scratch.source.shape[2]);
    check_shape("dipole", scratch.dipole, bodies, 3, scratch.dipole.shape[2]);
    check_range("samples", n, 0, std::min(scratch.source.shape[2], scratch.dipole.shape[2]) + 1);
    if (bank.transmissions.shape[1]) {
        check_shape("transmitted", scratch.transmitted, sets, bodies, scratch.transmitted.shape[2]);
        check_range("samples", n, 0, scratch.transmitted.shape[2] + 1);
    }
    for (int64_t d = 0; d < drives; ++d)
        for (int side = 0; side < 2; ++side) {
            check_range("body", scratch.body(d, side), -1, bodies);
            if (scratch.body(d, side) < 0) continue;
            const BankBody& body = bank.body[scratch.body(d, side)];
            check_range("gain0", body.stop - body.start, 0, columns + 1);
        }
}

void bind_bank(nb::module_& m) {
    add_dtype<BankBody>(m, "BANK_BODY");
    add_dtype<Ringing>(m, "RINGING");
    add_dtype<BankStrike>(m, "BANK_STRIKE");
    add_dtype<Transmission>(m, "TRANSMISSION");
    m.attr("LANE_PAIR") = LANE_PAIR;
    m.attr("BLOCK") = BLOCK;
    m.attr("FLOOR") = FLOOR;
    m.attr("FLUSH") = FLUSH;
    m.attr("NODES_PER_PULSE") = NODES_PER_PULSE;
    m.attr("NODES_PER_SAMPLE") = NODES_PER_SAMPLE;
    m.attr("SHORTEST_PULSE") = SHORTEST_PULSE;
    nb::dict phases;
    for (const auto& [name, value] : {std::pair{"off", phase::OFF},
                                      {"steady", phase::STEADY},
                                      {"coming", phase::COMING},
                                      {"rising", phase::RISING},
                                      {"leaving", phase::LEAVING},
                                      {"falling", phase::FALLING},
                                      {"brief", phase::BRIEF}})
        phases[name] = value;
    m.attr("TRANSMISSION_PHASES") = phases;
    m.def(
        "advance_bank",
        [](int64_t at, int64_t n, double sr, Array<const double, 1> progress, const BankTables& bank,
           const ScratchTables& scratch) {
            check_range("n", n, 0, INT64_MAX);
            check_shape("count", scratch.count, 2);
            check_shape("progress", progress, n);
            check_bank(bank);
            check_scratch(scratch, bank, n);
            nb::gil_scoped_release released;
            static thread_local BankWork work;
            advance_bank(at, n, sr, progress, bank, scratch, work);
        },
        "at"_a, "n"_a, "sr"_a, "progress"_a, "bank"_a, "scratch"_a,
        "Compute samples at … at + n - 1 of a bank into scratch: source (W, b, n or more) and dipole (b, 3, n or\n"
        "more). progress (n,): where between its gains each sample of a drive lies.");
    m.def(
        "enter_pulses",
        [](double begin_s, double after_s, int64_t at, double sr, const BankTables& bank,
           const ScratchTables& scratch) {
            check_shape("count", scratch.count, 2);
            check_bank(bank);
            check_range("count", scratch.count[0], 0, scratch.pulse.size() + 1);
            check_range("count", scratch.count[0], 0, scratch.modal_impulse.shape[0] + 1);
            check_shape("modal_impulse", scratch.modal_impulse, scratch.modal_impulse.shape[0], 2,
                        scratch.modal_impulse.shape[2]);
            check_range("at", at, -LATEST, LATEST);
            for (int64_t i = 0; i < scratch.count[0]; ++i) {
                const Pulse& pulse = scratch.pulse[i];
                check_number("start of a pulse", ((pulse.ahead ? after_s : begin_s) + pulse.start_s) * sr, -LATEST,
                             LATEST);
                check_number("length of a pulse", pulse.length_s * sr, 0, LATEST);
                for (int side = 0; side < 2; ++side) {
                    const int64_t b = pulse.body[side];
                    check_range("body", b, 0, bank.body.size());
                    check_range("modal_impulse", bank.body[b].stop - bank.body[b].start, 0,
                                scratch.modal_impulse.shape[2] + 1);
                }
            }
            return enter_pulses(begin_s, after_s, at, sr, bank, scratch);
        },
        "begin_s"_a, "after_s"_a, "at"_a, "sr"_a, "bank"_a, "scratch"_a,
        "Enter a step's pulses on both bodies of each, in order; return how many, fewer where the pool is full.");
    m.def(
        "enter_strike",
        [](int64_t body, double start, double length, bool flat, double fraction, Array<const double, 1> gain,
           Array<const double, 1> impulse_n_s, int64_t at, const BankTables& bank) {
            check_bank(bank);
            check_range("body", body, 0, bank.body.size());
            check_range("gain", bank.body[body].stop - bank.body[body].start, 0, gain.size() + 1);
            check_shape("impulse_n_s", impulse_n_s, 3);
            check_range("at", at, -LATEST, LATEST);
            check_number("start", start, static_cast<double>(at) - 0.5, LATEST);
            check_number("length", length, 0, LATEST);
            const BodyPulse pulse{start,    length,    flat,
                                  fraction, gain.data, {impulse_n_s[0], impulse_n_s[1], impulse_n_s[2]}};
            return enter_strike(body, pulse, at, bank);
        },
        "body"_a, "start"_a, "length"_a, "flat"_a, "fraction"_a, "gain"_a, "impulse_n_s"_a, "at"_a, "bank"_a,
        "Enter a pulse on one body, start and length in samples; return False where the pool is full.");
    m.def(
        "set_poles",
        [](int64_t b, Array<const Complex, 1> step, Array<const double, 1> separation, Array<const double, 2> free_law,
           const BankTables& bank) {
            check_bank(bank);
            check_range("body", b, 0, bank.body.size());
            check_shape("step", step, bank.body[b].columns);
            if (separation.size() > 0) check_shape("separation", separation, bank.body[b].columns);
            check_shape("free_law", free_law, 6, bank.law.shape[1]);
            set_poles(b, step, separation, free_law, bank);
        },
        "b"_a, "step"_a, "separation"_a, "free_law"_a, "bank"_a,
        "Set other poles s = (-d + iω)/sr (columns,) of a body from the next block's start, at once where nothing of\n"
        "it is active; separation (columns,) or (0,) for none.");
    m.def(
        "set_transmissions",
        [](int64_t b, Array<const int64_t, 1> to, Array<const Complex, 3> weight, const BankTables& bank) {
            check_bank(bank);
            check_range("body", b, 0, bank.body.size());
            check_shape("weight", weight, to.size(), bank.observed.shape[0], bank.body[b].columns);
            for (int64_t i = 0; i < to.size(); ++i) check_range("to", to[i], 0, bank.body.size());
            end_transmissions(b, bank);
            for (int64_t i = 0; i < to.size(); ++i)
                if (!begin_transmission(b, to[i], weight[i], bank)) break;
        },
        "b"_a, "to"_a, "weight"_a, "bank"_a,
        "Set what a body transmits from the next block's start, at once where nothing of it is active: weights\n"
        "(k, W, columns) to bodies (k,), to the first of them where there are too few places; what was, ends.");
    m.def(
        "filter_swing",
        [](Array<const double, 1> taps, Array<const double, 1> shape, Array<const double, 2> moved, Doubles past,
           Doubles swing) {
            check_shape("taps", taps, 5);
            check_shape("moved", moved, shape.size(), swing.size());
            check_shape("past", past, 2);
            nb::gil_scoped_release released;
            filter_swing(taps, shape, moved, past, swing);
        },
        "taps"_a, "shape"_a, "moved"_a, "past"_a, "swing"_a,
        "Filter Σ shape (6,) moved (6, n) by taps b0, b1, b2, a1, a2 into swing (n,); past (2,): of the samples\n"
        "before, changed.");
}

}  // namespace engine
