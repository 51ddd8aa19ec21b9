// Driver of the run time: physics steps in, samples out, all stages in one call.
//
//     contacts and poses of a step -> take_step: contact rows, load histories, into a window of SPAN steps
//         -> excite: pulses (strikes) and drives (friction) of the step LOOKAHEAD before
//         -> track_supports: contact patches, and new poles of bodies whose contacts they change
//         -> ring: modes and translations of all bodies -> source (W, b, n), dipole (b, 3, n)
//         -> finish: through the air to the microphones; other sensors sum their weight set over the bodies
//
// Live listening is this driver with one step, a replay the same with many: the result of a step depends on nothing
// else. It stops before a step for which a table is too small, having changed nothing of it; the caller enlarges the
// table and calls again. Sums in a fixed order: rows as they came, pairs by key, bodies by index.
#pragma once

#include <vector>

#include "../bank/bank.hpp"
#include "../contact/contact_scratch.hpp"
#include "../path/sound_path.hpp"
#include "pole_updates.hpp"

namespace engine {

// Why the driver returned; else it is another `PathStatus` of `hear`.
enum StepStatus : int64_t {
    STEPS_DONE = PATH_DONE,
    TABLE_SHORT = -1,  // a table is too small
    PAUSED = -2,       // asked to stop before `finish`
    BROKEN = -3,       // a sum is not finite, or a strike has no place
};

// How far the first step is.
enum StepProgress : int64_t { STEP_NEW = 0, STEP_RINGS = 1 };

// Steps that are taken in: (k,), contacts of all, poses (k, b, 3), (k, b, 4), teleports (k, b).
struct GivenSteps {
    Array<const StepRow, 1> steps;
    Array<const Contact, 1> contacts;
    Array<const double, 3> position;
    Array<const double, 3> quaternion;
    Array<const bool, 2> teleported;
    Array<const double, 4> aim_m;  // (k + 1, b, c, 3): `Course.aim_m` at each step's start and the last one's end
};

// What the driver fills: out (channels, ·) from sample `start` on, and pressure (microphones, ·).
struct Frames {
    int64_t start;
    bool apart;  // out is (b·channels, …) and pressure (b·microphones, …), body by body, nothing summed
    Array<const int64_t, 1> reads;  // (channels,): weight set of each, 0 for a microphone
    Array<const int64_t, 1> sets;   // (microphones,): weight set of each
    Array<double, 2> pressure;
    Array<double, 2> out;
};

// All tables of a state, and the memory that stages need for the length of a call.
struct RunTime {
    WindowTables window;
    BodyTables table;
    PairTables pairs;
    SupportTables supports;
    BankTables bank;
    ScratchTables scratch;
    PathTables path;
    PoleTables poles;

    ContactScratch contact_scratch;
    BankWork bank_work;
    PoleWork pole_work;
    std::vector<double> progress;    // of each sample in its step
    std::vector<double> image_gain;  // (2, b, c)
};

// What is asked of one call.
struct DriverCall {
    int64_t first;   // step of the table that is not done
    int64_t taken;   // number of the table's first
    bool pause;      // return before `finish` of the first step
    int64_t resume;  // StepProgress of the first step
    double sr;
};

struct DriverResult {
    int64_t done;  // steps
    int64_t status;
};

// Render the steps of the table from call.first on into frames.out (channels, samples of all of them).
// Of the last one, its pulses and drives are in the scratch.
DriverResult advance_steps(const DriverCall& call, const GivenSteps& given, const Frames& frames, RunTime& run);

}  // namespace engine
