#include "soft_impacts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace engine {

namespace {

constexpr double REST_FRACTION = 0.05;  // of the approach: speed that has settled
constexpr double TAIL_FRACTION = 0.03;  // of the peak load: load that has
enum Count { IMPACTS, HELD, PAIRS, ROWS };

template <class Row>
int64_t find_key(Array<Row, 1> table, int64_t count, int64_t key) {
    for (int64_t i = 0; i < count; ++i)
        if (table[i].key == key) return i;
    return -1;
}

int64_t key_of(const Contact& row) {
    return pair_key(std::min(row.a, row.b), std::max(row.a, row.b));
}

// The normal impulse of a row, 0 or more.
double load_of(const Contact& row) {
    const double *j = row.impulse_n_s, *n = row.normal;
    return std::max(j[0] * n[0] + j[1] * n[1] + j[2] * n[2], 0.0);
}

// The row with a fraction of its impulse.
Contact with_fraction(const Contact& row, double fraction) {
    Contact made = row;
    for (double& impulse : made.impulse_n_s) impulse = fraction * impulse;
    return made;
}

// Add a fraction of a row to the nearest point held of its pair that no other row of this step was added to.
void hold(const Contact& row, int64_t key, double fraction, const ImpactTables& tables) {
    int64_t best = -1;
    double nearest = std::numeric_limits<double>::infinity();
    for (int64_t i = 0; i < tables.counts[HELD]; ++i) {
        const HeldPoint& one = tables.held[i];
        if (one.key != key || one.taken != 0 || one.row.a != row.a) continue;
        double off = 0;
        for (int x = 0; x < 3; ++x) {
            const double step = one.latest_m[x] - row.point_a_m[x];
            off += step * step;
        }
        if (off < nearest) best = i, nearest = off;
    }
    const double load = fraction * load_of(row);
    if (best < 0) {
        best = tables.counts[HELD]++;
        HeldPoint& fresh = tables.held[best];
        fresh.key = key, fresh.weight_n_s = 0, fresh.row = with_fraction(row, 0);
        for (int x = 0; x < 3; ++x) fresh.row.point_a_m[x] = fresh.row.point_b_m[x] = fresh.row.normal[x] = 0;
    }
    HeldPoint& one = tables.held[best];
    one.taken = 1;
    one.weight_n_s += load;
    for (int x = 0; x < 3; ++x) {
        one.latest_m[x] = row.point_a_m[x];
        one.row.impulse_n_s[x] += fraction * row.impulse_n_s[x];
        one.row.point_a_m[x] += load * row.point_a_m[x];
        one.row.point_b_m[x] += load * row.point_b_m[x];
        one.row.normal[x] += load * row.normal[x];
    }
}

// The row of a strike: a held point, as far into the step as the surfaces met in the impact's first.
Contact strike_of(const HeldPoint& one, const SoftImpact& impact) {
    Contact made = one.row;
    made.approach_m_s = impact.approach_m_s, made.gap_m = impact.meets_s * impact.approach_m_s;
    double length = 0;
    for (int x = 0; x < 3; ++x) length += made.normal[x] * made.normal[x];
    for (int x = 0; x < 3; ++x) {
        made.point_a_m[x] /= one.weight_n_s, made.point_b_m[x] /= one.weight_n_s;
        made.normal[x] /= std::sqrt(length);
    }
    return made;
}

// Fill now: load and fastest loaded approach of each pair.
void sum_loads(Array<const Contact, 1> row, Array<const double, 1> weight_n, double dt_s, const ImpactTables& tables) {
    for (int64_t i = 0; i < row.size(); ++i) {
        const int64_t key = key_of(row[i]);
        const double load = load_of(row[i]);
        int64_t at = find_key(tables.now, tables.counts[PAIRS], key);
        if (at < 0) {
            at = tables.counts[PAIRS]++;
            tables.now[at] = {key, 0, weight_n[i], -std::numeric_limits<double>::infinity(), 0, -1};
        }
        PairLoad& pair = tables.now[at];
        pair.force_n += load / dt_s;
        if (load > 0 && row[i].approach_m_s > pair.approach_m_s)
            pair.approach_m_s = row[i].approach_m_s, pair.gap_m = row[i].gap_m;
    }
}

// Begin or continue the impact of a loaded pair; return its place, or -1 without one.
int64_t follow(const PairLoad& pair, double dt_s, double fall_m_s, const ImpactTables& tables) {
    int64_t at = find_key(tables.impact, tables.counts[IMPACTS], pair.key);
    if (at < 0) {
        const int64_t was = find_key(tables.before, tables.before.size(), pair.key);
        const double support_n = was >= 0 ? tables.before[was].force_n : 0.0;
        if (!(pair.approach_m_s > fall_m_s && pair.force_n > support_n)) return -1;
        at = tables.counts[IMPACTS]++;
        tables.impact[at] = {pair.key,
                             pair.approach_m_s,
                             pair.approach_m_s,
                             pair.gap_m / pair.approach_m_s,
                             std::max(support_n, pair.weight_n),
                             0,
                             0,
                             0,
                             0};
    }
    SoftImpact& impact = tables.impact[at];
    const double change = std::fabs(impact.latest_m_s - pair.approach_m_s);
    impact.approach_m_s = std::max(impact.approach_m_s, pair.approach_m_s), impact.latest_m_s = pair.approach_m_s;
    const double rest = REST_FRACTION * impact.approach_m_s;
    bool settled = impact.steps > 0 && std::fabs(pair.approach_m_s) <= rest &&
                   change * static_cast<double>(impact.steps) <= 2 * rest;
    impact.peak_n = std::max(impact.peak_n, pair.force_n);
    settled = settled || pair.force_n - impact.support_n <= TAIL_FRACTION * (impact.peak_n - impact.support_n);
    impact.over = settled || impact.elapsed_s >= LONGEST_IMPACT_S ? 1 : 0;
    impact.steps += 1, impact.elapsed_s = impact.elapsed_s + dt_s;
    return at;
}

// Write the part of a row that passes to out, and hold the rest.
void pass_row(const Contact& row, const PairLoad& pair, const ImpactTables& tables) {
    double fraction = 1;
    if (pair.impact >= 0 && tables.impact[pair.impact].over == 0 && load_of(row) > 0) {
        fraction = std::min(tables.impact[pair.impact].support_n / pair.force_n, 1.0);
        if (fraction < 1) hold(row, pair.key, 1 - fraction, tables);
    }
    if (fraction > 0) tables.out[tables.counts[ROWS]++] = with_fraction(row, fraction);
}

// Give out what impacts held that are over, and drop them.
void finish(const ImpactTables& tables) {
    int64_t kept = 0;
    for (int64_t i = 0; i < tables.counts[HELD]; ++i) {
        const SoftImpact& impact = tables.impact[find_key(tables.impact, tables.counts[IMPACTS], tables.held[i].key)];
        if (impact.over != 0) {
            tables.out[tables.counts[ROWS]++] = strike_of(tables.held[i], impact);
        } else {
            tables.held[kept++] = tables.held[i];
        }
    }
    tables.counts[HELD] = kept;
    kept = 0;
    for (int64_t i = 0; i < tables.counts[IMPACTS]; ++i)
        if (tables.impact[i].over == 0) tables.impact[kept++] = tables.impact[i];
    tables.counts[IMPACTS] = kept;
}

}  // namespace

void collect_rows(Array<const Contact, 1> row, Array<const double, 1> weight_n, double dt_s, double fall_m_s,
                  const ImpactTables& tables) {
    for (int64_t i = 0; i < tables.counts[HELD]; ++i) tables.held[i].taken = 0;
    for (int64_t i = 0; i < tables.counts[IMPACTS]; ++i) tables.impact[i].over = 1;  // unless the pair is loaded
    sum_loads(row, weight_n, dt_s, tables);
    for (int64_t i = 0; i < tables.counts[PAIRS]; ++i)
        if (tables.now[i].force_n > 0) tables.now[i].impact = follow(tables.now[i], dt_s, fall_m_s, tables);
    for (int64_t i = 0; i < row.size(); ++i)
        pass_row(row[i], tables.now[find_key(tables.now, tables.counts[PAIRS], key_of(row[i]))], tables);
    for (int64_t i = 0; i < tables.counts[PAIRS]; ++i) {  // what passed is the support of the next step
        PairLoad& pair = tables.now[i];
        if (pair.impact >= 0 && tables.impact[pair.impact].over == 0)
            pair.force_n = std::min(pair.force_n, tables.impact[pair.impact].support_n);
    }
    finish(tables);
}

}  // namespace engine
