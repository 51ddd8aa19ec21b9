#include "driver.hpp"

#include <algorithm>
#include <cmath>

#include "../bank/strike_pool.hpp"
#include "../contact/contact_patches.hpp"
#include "../contact/contact_rows.hpp"
#include "../contact/friction.hpp"
#include "../contact/load_splitting.hpp"
#include "../contact/strike_forces.hpp"
#include "../path/image_gains.hpp"

namespace engine {

namespace {

// Test whether the tables have room for a step of so many contacts.
bool has_room(int64_t contacts, const RunTime& run) {
    const int64_t bound = run.pairs.count[0] + contacts;
    return run.pairs.count[1] >= contacts && run.window.row.size() / SPAN >= contacts &&
           run.scratch.pulse.size() >= 2 * bound && run.scratch.slot.size() >= bound && run.bank.free[0] >= 4 * bound;
}

// Take step i of those given into the window as step `number`: its poses, its rows, the pairs' loads.
void take_step(int64_t i, int64_t number, const GivenSteps& given, RunTime& run) {
    const WindowTables& window = run.window;
    const StepRow& step = given.steps[i];
    const int64_t slot = number % SPAN, room = window.row.size() / SPAN, first = slot * room;
    const int64_t bodies = given.position.shape[1], contacts = step.row[1] - step.row[0];
    std::copy_n(given.position[i].data, 3 * bodies, window.position_m[slot].data);
    std::copy_n(given.quaternion[i].data, 4 * bodies, window.quaternion_xyzw[slot].data);
    std::copy_n(given.teleported[i].data, bodies, window.teleported[slot].data);
    orient(given.contacts.part(step.row[0], step.row[1]), window.quaternion_xyzw[slot],
           window.row.part(first, first + contacts), run.contact_scratch);
    Window& here = window.step[slot];
    here.dt_s = step.dt_s;
    std::copy_n(step.gravity_m_s2, 3, here.gravity_m_s2);
    here.row[0] = first, here.row[1] = first + contacts;
    enter_loads(window.row, first, first + contacts, step.dt_s, run.pairs, run.contact_scratch);
}

// Find strikes and friction of step `number`: its pulses and drives, as many as scratch.count tells.
void excite(int64_t number, bool quench, Array<const double, 1> x, double sr, RunTime& run) {
    const WindowTables& window = run.window;
    for (int64_t b = 0; b < run.table.bodies.size(); ++b)
        if (window.teleported((number + 1) % SPAN, b)) run.table.bodies[b].placed = number + 1;
    ContactScratch& memory = run.contact_scratch;
    const int64_t active = run.pairs.count[0];
    const Array<Strike, 1> strikes = room(memory.strikes, active);
    const Array<Voice, 1> voices = room(memory.voices, active);
    int64_t found = find_pulses(0, number, 0, window, run.table, run.pairs, strikes, run.scratch, memory);
    // else a strike after the quench would be dated back before it and be lost: it waits for its own step
    if (!quench) found = find_pulses(1, number + 1, found, window, run.table, run.pairs, strikes, run.scratch, memory);
    run.scratch.count[0] = found;
    advance_friction(number, x, sr, window, run.table, run.pairs, voices, run.scratch, memory);
}

// Update the support state of step `number`, and the poles of the bodies that are chosen. False where a number is not
// finite.
bool track_supports(int64_t number, double sr, RunTime& run) {
    const Window& here = run.window.step[number % SPAN];
    track_contact_patches(here, run.window.row, run.table, run.pairs, run.supports.support_state);
    const BankTables& bank = run.bank;
    count_separations(run.supports.support_state, {bank.body.data, bank.ringing.data, bank.law.data, bank.law.shape[1],
                                                   bank.z.data, bank.driven.data});
    const Array<SupportState, 1> supports = run.supports.support_state;
    if (choose_bodies(here.dt_s, run.table, run.pairs, run.supports, bank.ringing.data, run.scratch,
                      run.contact_scratch) == 0)
        return true;
    const ContactState state{run.table, run.pairs, bank, run.scratch, run.poles};
    for (int64_t b = 0; b < supports.size(); ++b) {
        if (!supports[b].wanted) continue;
        supports[b].wanted = 0, ++supports[b].updates;
        if (!update_poles(b, run.window.quaternion_xyzw[number % SPAN], sr, state, run.pole_work)) return false;
    }
    return true;
}

// Apply the step's pulses and drives to the bank: its source and dipole. False where a pulse found no place.
bool ring(const StepRow& step, Array<const double, 1> x, double sr, RunTime& run) {
    const int64_t entered = enter_pulses(step.begin_s, step.after_s, step.sample, sr, run.bank, run.scratch);
    advance_bank(step.sample, step.count, sr, x, run.bank, run.scratch, run.bank_work);
    return entered == run.scratch.count[0];
}

// Compute a step's signal at sensors that read modes themselves; false where it is not finite.
bool sum_at_sensors(Array<const double, 3> source, int64_t n, int64_t out_at, const Frames& frames) {
    const int64_t channels = frames.reads.size(), bodies = source.shape[1];
    for (int64_t c = 0; c < channels; ++c) {
        if (frames.reads[c] == 0) continue;
        for (int64_t k = 0; k < n; ++k) {
            double total = 0.0;
            for (int64_t b = 0; b < bodies; ++b) {
                const double value = source(frames.reads[c], b, k);
                total += value;
                if (frames.apart) frames.out(b * channels + c, out_at + k) = value;
            }
            if (!frames.apart) frames.out(c, out_at + k) = total;
            if (!std::isfinite(total)) return false;
        }
    }
    return true;
}

// Write step `number`, i of those given, which rings in the scratch, into frames.out: STEPS_DONE, or what is in the
// way.
int64_t finish(int64_t i, int64_t number, Array<const double, 1> x, const GivenSteps& given, const Frames& frames,
               RunTime& run) {
    const StepRow& step = given.steps[i];
    const WindowTables& window = run.window;
    const int64_t here = number % SPAN, there = (number + 1) % SPAN, at = step.sample - frames.start;
    const int64_t bodies = window.position_m.shape[1], microphones = run.path.microphone_m.shape[0];
    Array<const double, 4> aim_m = given.aim_m;
    if (aim_m.size() > 0) {
        aim_m.data += i * aim_m.stride();
        aim_m.shape[0] = 2;
    }
    Array<double, 3> gain{nullptr, {0, bodies, microphones}};
    if (window.images.size() > 0) {
        run.image_gain.resize(2 * bodies * microphones);
        gain = {run.image_gain.data(), {2, bodies, microphones}};
        const ImageScene scene{window.images,
                               window.has_image,
                               {window.position_m[here], window.position_m[there]},
                               {window.quaternion_xyzw[here], window.quaternion_xyzw[there]}};
        image_gains(scene, aim_m, run.path.microphone_m, gain);
    }
    const ScratchTables& scratch = run.scratch;
    const Emission emission{scratch.source, scratch.dipole, 0, frames.sets};
    const Course course{window.position_m[here], window.position_m[there], window.teleported[there], x, aim_m, gain};
    const Arrivals arrivals{frames.pressure, at, frames.apart};
    const int64_t status = hear(step.sample, number, step.count, emission, course, run.path, arrivals);
    if (status != PATH_DONE) return status;
    if (!sum_at_sensors(scratch.source, step.count, at, frames)) return BROKEN;
    int64_t microphone = 0;
    for (int64_t row = 0; row < frames.out.shape[0]; ++row) {
        if (frames.reads[row % frames.reads.size()] != 0) continue;
        if (frames.out.data != frames.pressure.data)
            std::copy_n(frames.pressure[microphone].data + at, step.count, frames.out[row].data + at);
        ++microphone;
    }
    return STEPS_DONE;
}

}  // namespace

DriverResult advance_steps(const DriverCall& call, const GivenSteps& given, const Frames& frames, RunTime& run) {
    int64_t done = 0;
    for (int64_t i = call.first; i < given.steps.size(); ++i, ++done) {
        const StepRow& step = given.steps[i];
        const int64_t taken = call.taken + i, number = taken - LOOKAHEAD;
        const int64_t progress = i == call.first ? call.resume : STEP_NEW;
        if (progress == STEP_NEW) {
            if (!has_room(step.row[1] - step.row[0], run)) return {done, TABLE_SHORT};
            take_step(i, taken, given, run);
        }
        if (number < 0) continue;
        run.progress.resize(step.count);
        const double samples = run.window.step[number % SPAN].dt_s * call.sr;
        for (int64_t k = 0; k < step.count; ++k)
            run.progress[k] = std::min(std::max((k + step.offset) / samples, 0.0), 1.0);
        const Array<const double, 1> x{run.progress.data(), {step.count}};
        if (progress == STEP_NEW) {
            excite(number, step.quench != 0, x, call.sr, run);
            if (run.supports.credit_s.size() > 0 && !track_supports(number, call.sr, run)) return {done, BROKEN};
        }
        if (progress != STEP_RINGS) {
            if (!ring(step, x, call.sr, run)) return {done, BROKEN};
            if (call.pause) return {done, PAUSED};
        }
        const int64_t status = finish(i, number, x, given, frames, run);
        if (status != STEPS_DONE) return {done, status};
    }
    return {done, STEPS_DONE};
}

}  // namespace engine
