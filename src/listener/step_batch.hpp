// Steps of the same bodies that wait to be logged and to sound: tables that grow, a step at a time.
//
//     a step as it was read -> add_step -> rows at the end of each table
#pragma once

#include <memory>
#include <vector>

#include "step_contacts.hpp"

namespace engine {

// A step of a batch; its poses are the next b rows.
struct WaitingStep {
    double dt_s;
    double gravity_m_s2[3];
    int64_t contact_end;  // of its rows among the batch's contacts
};
ROW_FIELDS(WaitingStep, dt_s, gravity_m_s2, contact_end)

struct StepBatch {
    int64_t bodies = 0;
    std::vector<WaitingStep> step;
    std::vector<Contact> contact;
    std::vector<double> position_m;       // (s, b, 3)
    std::vector<double> quaternion_xyzw;  // (s, b, 4)
    std::vector<unsigned char> moved;     // (s, b), 1 where a body was moved by hand
    std::unique_ptr<bool[]> moved_now;    // (b,) the same of the step that is added
};

// Empty a batch, for steps of so many bodies.
void clear_batch(StepBatch& batch, int64_t bodies);

// Add a step (see take_step), which has these loaded contacts and starts from `start`; return what take_step does. The
// batch is as it was where there are no rows. loaded has room for all reported contacts.
StepCounts add_step(const ReadStep& read, const double gravity_m_s2[3], const TraceTables& traces,
                    Array<LoadedContact, 1> loaded, Array<LinkStart, 1> start, StepBatch& batch);

}  // namespace engine
