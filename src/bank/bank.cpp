#include "bank.hpp"

#include <algorithm>

#include "drive.hpp"
#include "poles.hpp"
#include "strike_pool.hpp"
#include "tile.hpp"
#include "translation.hpp"
#include "transmission.hpp"

namespace engine {

namespace {

int64_t place_in_block(int64_t sample) {
    return sample & (BLOCK - 1);
}

int64_t place_in_driven(int64_t sample) {
    return sample & (DRIVEN - 1);
}

// Let the block's free sound of aimed sets pass from the weights as they were to those from its end on.
void blend_aims(int64_t b, const BankTables& bank) {
    for (int64_t w = 0; w < bank.observed.shape[0]; ++w) {
        const int64_t k = bank.aims[w];
        if (k < 0 || !bank.turned(k, b) || !bank.observed(w, b)) continue;
        double* sound = bank.sound[w][b].data;
        for (int64_t n = 0; n < BLOCK; ++n) sound[n] += static_cast<double>(n) / BLOCK * (bank.blend(k, n) - sound[n]);
    }
}

// Let what is driven from here on have the new weights of aimed sets.
void take_aim(int64_t b, const BankTables& bank) {
    const int64_t modes = bank.law.shape[1];
    for (int64_t k = 0; k < bank.turned.shape[0]; ++k) {
        if (!bank.turned(k, b)) continue;
        bank.turned(k, b) = 0;
        for (int64_t re = bank.body[b].start; re < bank.body[b].stop; ++re) {
            bank.aim(2 * k, re) = bank.aim(2 * k + 1, re);
            bank.aim(2 * k, re + modes) = bank.aim(2 * k + 1, re + modes);
        }
    }
}

// Set what a body's block of free sound is added to, to 0.
void clear_block(int64_t b, int64_t partners, const BankTables& bank) {
    const int64_t sets = bank.observed.shape[0];
    for (int64_t w = 0; w < sets; ++w)
        if (bank.observed(w, b)) set_zero(bank.sound[w][b].data, BLOCK);
    set_zero(bank.blend.data, bank.blend.shape[0] * BLOCK);
    for (int64_t w = 0; w < partners * sets; ++w) set_zero(bank.transmission_sound[w][b].data, BLOCK);
}

// Compute the tiles of body b for the block that starts: sound (W, b, BLOCK), transmission_sound (J·W, b, BLOCK).
//
// Advances z to the next block. False where all modes are below the floor.
bool ring_block(int64_t b, const BankTables& bank, BankWork& work) {
    const Tile& vector = tile();
    const int64_t start = bank.body[b].start, columns = bank.body[b].columns, modes = bank.law.shape[1];
    const int64_t sets = bank.observed.shape[0];
    const int64_t partners = bank.ringing[b].transmissions ? bank.transmissions.shape[1] : 0;
    const int64_t end = start + (columns + LANES - 1) / LANES * LANES;
    bool active = false;
    for (int64_t low = start; low < end; low += CHUNK) {
        const Lanes lanes{modes, low, std::min(CHUNK, end - low)};
        if (!vector.turn(bank.z.data, bank.pole.data, bank.block.data, lanes, FLOOR, work.now, work.powers)) continue;
        if (!active) clear_block(b, partners, bank);
        active = true;
        const int64_t real = std::min(lanes.count, start + columns - low);  // spare lanes need no table
        vector.rows(work.powers, real, work.table);
        const auto add = [&](const double* weight, double* sound) {
            vector.columns(work.now, weight, lanes, work.powers, work.column);
            vector.outer(work.column, work.table, real, sound);
        };
        for (int64_t w = 0; w < sets; ++w) {
            if (!bank.observed(w, b)) continue;
            const int64_t k = bank.aims[w];
            add(k < 0 ? bank.weight[w].data : bank.aim[2 * k].data, bank.sound[w][b].data);
            if (k >= 0 && bank.turned(k, b)) add(bank.aim[2 * k + 1].data, bank.blend[k].data);
        }
        for (int64_t j = 0; j < partners; ++j)
            if (is_active(bank.transmissions(b, j)))
                for (int64_t w = j * sets; w < (j + 1) * sets; ++w)
                    add(bank.transmission_weight[w].data, bank.transmission_sound[w][b].data);
    }
    if (active) blend_aims(b, bank);
    return active;
}

// Begin a block: take new poles and those that depend on the level, and compute its free sound.
void open_block(int64_t b, const BankTables& bank, BankWork& work) {
    const BankBody& body = bank.body[b];
    Ringing& ringing = bank.ringing[b];
    take_coming(b, bank);
    move_transmissions_on(b, bank);
    if (body.bent && ringing.ringing) bend_poles(b, BLOCK, bank);
    const bool active = ringing.ringing && ring_block(b, bank, work);
    ringing.tiled = ringing.ringing = active ? 1 : 0;
    take_aim(b, bank);
}

// End a block: what was driven within it is added to the free state of the next.
void close_block(int64_t b, const BankTables& bank) {
    const int64_t modes = bank.law.shape[1];
    for (int64_t re = bank.body[b].start; re < bank.body[b].stop; ++re) {
        const int64_t im = re + modes;
        const double x = bank.driven[re], y = bank.driven[im];
        bank.z[re] += x * bank.pole[re] - y * bank.pole[im];
        bank.z[im] += x * bank.pole[im] + y * bank.pole[re];
        bank.driven[re] = 0;
        bank.driven[im] = 0;
    }
}

// List forces by body: work.first (b + 1,) where each body's begin in work.side, 2·drive + side each, in their order;
// and work.signal: impulses at both ends, F·period·(1 - x) and F·period·x, 0 behind the last. Gains and impulses below
// FLUSH become 0, the gains in place.
void list_forces(int64_t n, const double* progress, double period_s, const BankTables& bank,
                 const ScratchTables& scratch, BankWork& work) {
    const int64_t bodies = bank.body.size(), drives = scratch.count[1], stride = n + LANES;
    int64_t* first = work.first.data();
    std::fill_n(first, bodies + 1, 0);
    for (int64_t d = 0; d < drives; ++d)
        for (int s = 0; s < 2; ++s)
            if (scratch.body(d, s) >= 0) ++first[scratch.body(d, s) + 1];
    for (int64_t b = 0; b < bodies; ++b) first[b + 1] += first[b];
    // counting sort: first advances to each body's end, and is shifted back afterwards
    for (int64_t d = 0; d < drives; ++d) {
        for (int s = 0; s < 2; ++s) {
            const int64_t b = scratch.body(d, s);
            if (b < 0) continue;
            work.side[first[b]++] = 2 * d + s;
            for (double* gain : {scratch.gain0[d][s].data, scratch.gain1[d][s].data})
                drive().copy_flushed(gain, bank.body[b].columns, gain);
        }
        double *early = work.signal.data() + 2 * d * stride, *late = early + stride;
        drive().part_force(scratch.force.data + d * n, progress, period_s, n, early, late);
        set_zero(early + n, stride - n);
        set_zero(late + n, stride - n);
    }
    for (int64_t b = bodies; b > 0; --b) first[b] = first[b - 1];
    first[0] = 0;
}

// Set impulse to body b's strikes on COLUMNS lanes, or what is left, from ``column`` on; return whether there are any.
//
// keep: their phasors advance, and with the last lanes they themselves.
bool add_strikes(int64_t b, const Stretch& stretch, int64_t column, bool keep, const BankTables& bank, BankWork& work) {
    bool used = false;
    const int64_t left = bank.body[b].stop - bank.body[b].start - column, lanes = std::min(COLUMNS, left);
    const bool final = keep && left <= COLUMNS;
    const int64_t sample = stretch.at + stretch.i, width = bank.rows.shape[2];
    for (int64_t slot = bank.ringing[b].strike; slot >= 0; slot = bank.strikes[slot].next) {
        if (!bank.strikes[slot].modal || bank.strikes[slot].first >= sample + stretch.count) continue;
        if (!used) drive().clear(work.impulse, lanes, stretch.count);
        used = true;
        const NodeSpan span = plan_nodes(slot, sample, stretch.count, bank, work.plan, work.due, final);
        const StrikePhasors phasors{bank.rows[slot].data + column, width, work.plan, work.due, span.first, span.stop};
        drive().strike(work.impulse, phasors, lanes, keep);
    }
    return used;
}

// The weights of a set, by those of body and of its transmissions: set w of all, of partner j where it is 0 or above.
const double* weights_of_set(int64_t w, int64_t j, const BankTables& bank) {
    if (j >= 0) return bank.transmission_weight[w - bank.observed.shape[0]].data;
    return bank.aims[w] >= 0 ? bank.aim[2 * bank.aims[w]].data : bank.weight[w].data;
}

// Set out (stretch.count,) to what forces and strikes on body b send beside its modes, by weights of pressure.
void send_direct(int64_t b, const Stretch& stretch, const double* weight, const BodyForces& forces,
                 const BankTables& bank, const ScratchTables& scratch, BankWork& work) {
    const int64_t start = bank.body[b].start, lanes = bank.body[b].stop - start;
    set_zero(work.direct, stretch.count);
    if (forces.stop > forces.first)
        drive().lasting_forces({bank.driven.data, bank.pole.data, weight + start, bank.law[2].data + start,
                                bank.law.shape[1], start, lanes},
                               work.lasting.data());
    for (int64_t f = forces.first; f < forces.stop; ++f) {
        const int64_t d = forces.side[f] >> 1, side = forces.side[f] & 1;
        const double early = drive().dot(work.lasting.data(), scratch.gain0[d][side].data, lanes);
        const double late = drive().dot(work.lasting.data(), scratch.gain1[d][side].data, lanes);
        const double* signal = forces.signal + 2 * d * forces.stride + stretch.i;
        for (int64_t k = 0; k < stretch.count; ++k)
            work.direct[k] += signal[k] * early + signal[forces.stride + k] * late;
    }
    send_strikes(b, stretch, weight + start, bank, work.direct);
}

// Advance body b by a stretch within one of the DRIVEN; sum driven and free part.
void drive_stretch(int64_t b, const Stretch& stretch, int64_t signal_stride, const BankTables& bank,
                   const ScratchTables& scratch, BankWork& work) {
    const Drive& vector = drive();
    Ringing& ringing = bank.ringing[b];
    const int64_t modes = bank.law.shape[1], count = stretch.count;
    const int64_t start = bank.body[b].start, stop = bank.body[b].stop;
    const BodyForces forces{work.side.data(), work.first[b], work.first[b + 1], work.signal.data(), signal_stride};
    const bool forced = forces.stop > forces.first;
    ringing.driven = 1;
    const int64_t sets = bank.observed.shape[0], last = last_weight_set(b, bank);
    for (int64_t w = 0; w <= last; ++w) {  // each active weight set in turn: the state advances with the last
        const int64_t j = w / sets - 1, v = w % sets;  // of partner j, where it is 0 or above
        if (w > 0 && !(j < 0 ? bank.observed(v, b) : is_active(bank.transmissions(b, j)))) continue;
        const bool keep = w == last;
        const double* weight = weights_of_set(w, j, bank);
        const bool heard = j >= 0 || bank.observed(v, b);
        const bool direct = heard && bank.radiates[v] && (forced || ringing.strike >= 0);
        if (direct) send_direct(b, stretch, weight, forces, bank, scratch, work);
        set_zero(work.partial, count * LANES);
        for (int64_t low = start; low < stop; low += COLUMNS) {
            const int64_t column = low - start, lanes = std::min(COLUMNS, stop - low);
            if (forced) {
                const ForceGains gains{scratch.gain0.data, scratch.gain1.data, scratch.gain0.shape[2], column};
                vector.project_forces(work.push, gains, forces, stretch.i, lanes, count);
            }
            const bool struck = ringing.strike >= 0 && add_strikes(b, stretch, column, keep, bank, work);
            const DrivenModes driven{
                bank.driven.data, bank.pole.data, weight + low, bank.law[2].data + low, modes, low, lanes};
            vector.run(driven, struck ? work.impulse : nullptr, forced ? work.push : nullptr, count, work.partial,
                       keep);
        }
        if (!heard) continue;
        vector.across(work.partial, count, work.total);
        if (direct)
            for (int64_t k = 0; k < count; ++k) work.total[k] += work.direct[k];
        if (ringing.tiled) {
            const double* free = j < 0 ? bank.sound[w][b].data : bank.transmission_sound[w - sets][b].data;
            free += place_in_block(stretch.at + stretch.i);
            for (int64_t k = 0; k < count; ++k) work.total[k] += free[k];
        }
        if (j < 0)
            vector.copy_flushed(work.total, count, scratch.source[w][b].data + stretch.i);
        else
            transmit(b, j, v, stretch, work.total, bank, scratch.transmitted);
    }
}

// Compute a stretch of a body that only rings, or is silent.
void sound_free(int64_t b, const Stretch& stretch, const BankTables& bank, const ScratchTables& scratch) {
    const int64_t sets = bank.observed.shape[0], place = place_in_block(stretch.at + stretch.i);
    const Ringing& ringing = bank.ringing[b];
    for (int64_t w = 0; w < sets; ++w) {
        if (!bank.observed(w, b)) continue;
        double* out = scratch.source[w][b].data + stretch.i;
        if (ringing.tiled)
            drive().copy_flushed(bank.sound[w][b].data + place, stretch.count, out);
        else
            set_zero(out, stretch.count);
    }
    if (!ringing.transmissions || !ringing.tiled) return;
    for (int64_t j = 0; j < bank.transmissions.shape[1]; ++j)
        if (is_active(bank.transmissions(b, j)))
            for (int64_t w = 0; w < sets; ++w)
                transmit(b, j, w, stretch, bank.transmission_sound[j * sets + w][b].data + place, bank,
                         scratch.transmitted);
}

// Compute samples at … at + n - 1 of body b's modes into scratch.source (W, b, n or more).
void advance_modes(int64_t at, int64_t n, int64_t b, const BankTables& bank, const ScratchTables& scratch,
                   BankWork& work) {
    Ringing& ringing = bank.ringing[b];
    const bool forced = work.first[b + 1] > work.first[b];
    for (int64_t i = 0; i < n;) {
        const int64_t place = place_in_block(at + i);
        if (place == 0) open_block(b, bank, work);
        int64_t end = std::min(n, i + BLOCK - place);
        if (ringing.driven || forced || ringing.strike >= 0) end = std::min(end, i + DRIVEN - place_in_driven(at + i));
        const Stretch stretch{at, i, end - i};
        if (ringing.driven || forced || has_nodes_before(b, at + end, bank)) {
            // driven motion begins with the poles of the free ringing
            if (bank.body[b].bent && (!ringing.driven || place_in_driven(at + i) == 0)) bend_poles(b, DRIVEN, bank);
            drive_stretch(b, stretch, n + LANES, bank, scratch, work);
        } else {
            sound_free(b, stretch, bank, scratch);
        }
        if (place + end - i == BLOCK) {
            ringing.tiled = 0;
            if (ringing.driven) {
                close_block(b, bank);
                ringing.ringing = 1;
                ringing.driven = 0;
            }
        }
        i = end;
    }
}

void clear_rows(Array<double, 2> rows) {
    set_zero(rows.data, rows.shape[0] * rows.shape[1]);
}

}  // namespace

void advance_bank(int64_t at, int64_t n, double sr, Array<const double, 1> progress, const BankTables& bank,
                  const ScratchTables& scratch, BankWork& work) {
    const Array<int64_t, 2>& sounds = scratch.sounds;
    work.make_room(bank.body.size(), scratch.count[1], n, scratch.gain0.shape[2]);
    list_forces(n, progress.data, 1.0 / sr, bank, scratch, work);
    for (int64_t b = 0; b < bank.body.size(); ++b) {
        const BankBody& body = bank.body[b];
        const Ringing& ringing = bank.ringing[b];
        const bool forced = work.first[b + 1] > work.first[b];
        const bool active = body.columns > 0 && (ringing.ringing || ringing.driven || ringing.tiled || forced ||
                                                 has_nodes_before(b, at + n, bank));
        if (active) {
            advance_modes(at, n, b, bank, scratch, work);
        } else if (sounds(b, 0)) {
            for (int64_t w = 0; w < bank.observed.shape[0]; ++w)
                set_zero(scratch.source[w][b].data, scratch.source.shape[2]);
        }
        sounds(b, 0) = active ? 1 : 0;
        const bool moves = body.rigid && translate(at, n, b, n + LANES, bank, scratch, work);
        if (!moves && sounds(b, 1)) clear_rows(scratch.dipole[b]);
        sounds(b, 1) = moves ? 1 : 0;
        if (ringing.strike >= 0) release_done_strikes(b, bank);
    }
    if (bank.transmissions.shape[1]) add_transmitted(n, bank, scratch);
}

}  // namespace engine
