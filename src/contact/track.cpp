#include "track.hpp"

namespace engine {

double sweep_track(double swept_m, const double (&speed_m_s)[2], Array<const double, 1> x, const Track& track,
                   const double (&gains)[2][OCTAVES], double per_sample_s, double* rate_m_s) {
    for (int64_t i = 0; i < x.size(); ++i) {
        const double pace_m_s = speed_m_s[0] + (speed_m_s[1] - speed_m_s[0]) * x[i];
        swept_m += pace_m_s * per_sample_s;
        const double place = swept_m / track.spacing_m;
        const int64_t whole = static_cast<int64_t>(place), first = whole % track.count;
        const int64_t second = first + 1 < track.count ? first + 1 : 0;
        const double t = place - whole;
        double slope = 0.0;
        for (int j = 0; j < OCTAVES; ++j) {
            const double gain = gains[0][j] + (gains[1][j] - gains[0][j]) * x[i];
            if (gain == 0.0) continue;
            const double* octave = track.slopes + j * track.count;
            slope += gain * (octave[first] + t * (octave[second] - octave[first]));
        }
        rate_m_s[i] += slope * pace_m_s;
    }
    return swept_m;
}

}  // namespace engine
