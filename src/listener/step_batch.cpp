#include "step_batch.hpp"

#include <algorithm>

namespace engine {

namespace {

// Keep the first so many steps, and all their rows.
void shrink(StepBatch& batch, size_t steps, size_t contacts) {
    const size_t poses = steps * static_cast<size_t>(batch.bodies);
    batch.contact.resize(contacts);
    batch.position_m.resize(3 * poses), batch.quaternion_xyzw.resize(4 * poses), batch.moved.resize(poses);
}

}  // namespace

void clear_batch(StepBatch& batch, int64_t bodies) {
    if (!batch.moved_now || batch.bodies != bodies) batch.moved_now = std::make_unique<bool[]>(bodies);
    batch.bodies = bodies;
    batch.step.clear();
    shrink(batch, 0, 0);
}

StepCounts add_step(const ReadStep& read, const double gravity_m_s2[3], const TraceTables& traces,
                    Array<LoadedContact, 1> loaded, Array<LinkStart, 1> start, StepBatch& batch) {
    const size_t steps = batch.step.size(), contacts = batch.contact.size();
    const int64_t count = read.reported.size(), bodies = batch.bodies, before = static_cast<int64_t>(steps) * bodies;
    shrink(batch, steps + 1, contacts + static_cast<size_t>(count));
    const StepTables made{loaded,
                          start,
                          {batch.contact.data() + contacts, {count}},
                          {{batch.position_m.data() + 3 * before, {bodies, 3}},
                           {batch.quaternion_xyzw.data() + 4 * before, {bodies, 4}},
                           {batch.moved_now.get(), {bodies}}}};
    const StepCounts counts = take_step(read, traces, made);
    if (counts.rows < 0) {
        shrink(batch, steps, contacts);
        return counts;
    }
    std::copy_n(batch.moved_now.get(), bodies, batch.moved.data() + before);
    batch.contact.resize(contacts + static_cast<size_t>(counts.rows));
    WaitingStep step{read.dt_s, {}, static_cast<int64_t>(batch.contact.size())};
    std::copy_n(gravity_m_s2, 3, step.gravity_m_s2);
    batch.step.push_back(step);
    return counts;
}

}  // namespace engine
