#include "contact_oscillator.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "../math/elementary.hpp"
#include "contact_oscillator_vector.hpp"
#include "hertz.hpp"
#include "profile.hpp"
#include "track.hpp"

namespace engine {

double dissipation_s_m(double restitution) {
    return restitution < 1.0 ? 1.5 * (1.0 - restitution) : 0.0;
}

double contact_radius_m(double relative_curvature_per_m, double flat_area_m2) {
    const double blunt_m = flat_area_m2 > 0.0 ? std::sqrt(flat_area_m2 / std::numbers::pi) : 1.0;
    return relative_curvature_per_m * blunt_m > 1.0 ? 1.0 / relative_curvature_per_m : blunt_m;
}

ContactLaw contact_law(const Pair& pair, const Voice& voice, double sr) {
    constexpr double pi = std::numbers::pi;
    ContactLaw law;
    const double mass_kg = pair.mass_kg, modulus_pa = pair.modulus_pa;
    const double k = ball_stiffness(modulus_pa, pair.radius_m);
    const double soft = 1.5 * engine::pow(k, 2.0 / 3.0);
    const double most_n = voice.load_n[0] > voice.load_n[1] ? voice.load_n[0] : voice.load_n[1];
    // half a radian a substep at rest leaves room for collisions four times (√δ twice) as stiff
    const double turn = 2.0 * std::sqrt(soft * engine::pow(most_n, 1.0 / 3.0) / mass_kg) / sr;
    law.substeps = std::ceil(turn);
    law.substeps = law.substeps < 1.0 ? 1.0 : law.substeps;
    law.substeps = law.substeps > MOST_SUBSTEPS ? MOST_SUBSTEPS : law.substeps;
    const double h = 1.0 / (sr * law.substeps);
    double limit_m = mass_kg / (1.5 * k * (h * h));
    limit_m *= limit_m;
    law.rate_unit = h / limit_m;
    law.force_unit_n = k * engine::pow(limit_m, 1.5);
    for (int end = 0; end < 2; ++end) {
        const double load_n = voice.load_n[end];
        const double depth_m = load_n <= law.force_unit_n ? engine::pow(load_n / k, 2.0 / 3.0)
                                                          : limit_m + (load_n - law.force_unit_n) * (h * h) / mass_kg;
        const double least_n = 1e-3 * 9.81 * mass_kg, loaded_n = load_n > least_n ? load_n : least_n;
        const double loss_s_m =
            2.0 * pair.damping_ratio * std::sqrt(mass_kg * soft) * engine::pow(loaded_n, -5.0 / 6.0);
        law.rest_depth[end] = depth_m / limit_m;
        law.damping[end] = (pair.dissipation_s_m > loss_s_m ? pair.dissipation_s_m : loss_s_m) * limit_m / h;
        const double patch_m = ball_patch_m(load_n, modulus_pa, pair.radius_m);
        const double pressure_pa = patch_m > 0.0 ? load_n / (pi * patch_m * patch_m) : 0.0;
        law.patch_m[end] = patch_m;
        law.touching[end] =
            pair.slope > 0.0 ? engine::erf(std::sqrt(pi) * pressure_pa / (modulus_pa * pair.slope)) : 0.0;
    }
    const double change = pair.substeps / law.substeps;  // 0: a new contact
    const double square = change * change;
    law.depth = pair.depth * (square * square);
    law.separation_speed = pair.separation_speed * (square * square * change);
    law.still = true;
    for (const auto& speeds : voice.sweep_m_s)
        for (double speed : speeds) law.still = law.still && speed == 0.0;
    return law;
}

// Order the voices by substeps, so that few lanes wait for others.
static void line_up(Array<Voice, 1> voices, Array<const ContactLaw, 1> laws) {
    int64_t last = 0;
    for (int substeps = 1; substeps <= MOST_SUBSTEPS; ++substeps)
        for (int64_t v = 0; v < voices.size(); ++v)
            if (laws[v].substeps == substeps) voices[last++].order = v;
}

// Add dh/dt of both sides of a pair to its samples, by its tracks or its octaves.
static void sweep_sides(Pair& pair, const Voice& voice, const ContactLaw& law, Array<const double, 1> x, double sr,
                        Array<const double, 1> tracks, double* rate_m_s, ContactScratch& memory) {
    for (int side = 0; side < 2; ++side) {
        const double speed_m_s[2] = {voice.sweep_m_s[0][side], voice.sweep_m_s[1][side]};
        if (speed_m_s[0] == 0.0 && speed_m_s[1] == 0.0) continue;
        double height_m[2][OCTAVES];
        for (int end = 0; end < 2; ++end)
            gained_heights(pair.height_m[side], speed_m_s[end], {law.patch_m[end], law.touching[end], pair.ball_m}, sr,
                           height_m[end]);
        if (pair.track_count[side] > 0) {
            const Track track{tracks.data + pair.track_at[side], pair.track_count[side], pair.track_spacing_m[side]};
            pair.swept_m[side] = sweep_track(pair.swept_m[side], speed_m_s, x, track, height_m, 1.0 / sr, rate_m_s);
        } else {
            const RoughSurface surface{pair.seed[side], {pair.around[side], pair.stretch[side]}};
            pair.swept_m[side] =
                sweep_profile(pair.swept_m[side], speed_m_s, x, surface, height_m, 1.0 / sr, rate_m_s, memory.lattice);
        }
    }
}

void sound_voices(Array<Pair, 1> pairs, Array<Voice, 1> voices, Array<const double, 1> x, double sr,
                  Array<const double, 1> tracks, Array<double, 2> force_n, ContactScratch& memory) {
    const int64_t n = x.size(), count = voices.size(), length = (n + LANES - 1) & -LANES;
    if (count == 0 || n == 0) return;
    Array<ContactLaw, 1> laws = room(memory.laws, count);
    double* rate = room(memory.rate_m_s, LANES * length).data;
    for (int64_t v = 0; v < count; ++v) laws[v] = contact_law(pairs[voices[v].slot], voices[v], sr);
    line_up(voices, laws);
    for (int64_t first = 0; first < count; first += LANES) {
        OscillatorLanes lanes;
        set_zero(rate, LANES * length);
        for (int lane = 0; lane < LANES; ++lane) {
            const bool filled = first + lane < count;
            const int64_t v = voices[filled ? first + lane : count - 1].order;  // unused lanes repeat the last
            ContactLaw& law = laws[v];
            Pair& pair = pairs[voices[v].slot];
            double* own = rate + lane * length;
            if (filled) sweep_sides(pair, voices[v], law, x, sr, tracks, own, memory);
            if (pair.substeps == 0) law.separation_speed = own[0] * law.rate_unit;  // a new one: the profile's velocity
            lanes.depth[lane] = law.depth, lanes.separation_speed[lane] = law.separation_speed;
            lanes.rest_depth[lane] = law.rest_depth[0];
            lanes.rest_growth[lane] = law.rest_depth[1] - law.rest_depth[0];
            lanes.damping[lane] = law.damping[0], lanes.damping_growth[lane] = law.damping[1] - law.damping[0];
            lanes.rate_unit[lane] = law.rate_unit, lanes.force_unit_n[lane] = law.force_unit_n;
            lanes.substeps[lane] = law.substeps, lanes.still[lane] = law.still;
        }
        lanes.most_substeps = static_cast<int64_t>(lanes.substeps[LANES - 1]);
        oscillator_vector().oscillate(lanes, x.data, n, rate, length);
        for (int lane = 0; lane < LANES && first + lane < count; ++lane) {
            const int64_t v = voices[first + lane].order;
            Pair& pair = pairs[voices[v].slot];
            pair.depth = lanes.depth[lane], pair.separation_speed = lanes.separation_speed[lane];
            pair.substeps = static_cast<int64_t>(laws[v].substeps);
            std::copy(rate + lane * length, rate + lane * length + n, force_n[v].data);
        }
    }
}

}  // namespace engine
