#include "load_splitting.hpp"

#include <algorithm>

namespace engine {

double opening(const double (&force_n)[HISTORY], int column) {
    double best = 0.0;
    if (force_n[column] > 0.0) {
        for (int first = std::max(column - SPAN + 1, 0); first <= column; ++first) {
            double least = force_n[first];
            for (int i = first + 1; i < std::min(first + SPAN, HISTORY); ++i) least = std::min(least, force_n[i]);
            best = std::max(best, least);
        }
    }
    return best;
}

// Return the first row of first … stop - 1, sorted by pair, whose key is not below one.
static int64_t first_row_of(Array<const ContactRow, 1> rows, int64_t first, int64_t stop, int64_t key) {
    while (first < stop) {
        const int64_t middle = (first + stop) / 2;
        if (rows[middle].key < key) {
            first = middle + 1;
        } else {
            stop = middle;
        }
    }
    return stop;
}

int64_t split_loads(int64_t ahead, int64_t number, const WindowTables& window, const PairTables& pairs,
                    Array<Strike, 1> strikes) {
    const int column = NOW + static_cast<int>(ahead);
    int64_t found = 0;
    for (int64_t i = 0; i < pairs.count[0]; ++i) {
        Pair& pair = pairs.pair[pairs.active[i]];
        if (!(pair.force_n[column] > pair.force_n[column - 1])) continue;
        Strike& strike = strikes[found];
        for (int j = 0; j < STEPS; ++j) strike.fraction[j] = 0.0;
        for (int j = 0; j < STEPS; ++j) {
            const double load_n = pair.force_n[column + j];
            const double excess_n = load_n - opening(pair.force_n, column + j) - pair.struck_n[column + j];
            if (!(excess_n > 1e-9 * load_n)) break;  // rounding of the sums is no impact
            pair.struck_n[column + j] += excess_n;
            strike.fraction[j] = excess_n / load_n;
            const int64_t (&row)[2] = window.step[(number + j) % SPAN].row;
            const int64_t first = first_row_of(window.row, row[0], row[1], pair.key);
            int64_t stop = first;
            while (stop < row[1] && window.row[stop].key == pair.key) ++stop;
            strike.row[j][0] = first, strike.row[j][1] = stop;
        }
        if (strike.fraction[0] > 0.0) {
            strike.body[0] = pair.body[0], strike.body[1] = pair.body[1];
            ++found;
        }
    }
    return found;
}

}  // namespace engine
