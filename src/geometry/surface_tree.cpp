#include "surface_tree.hpp"

#include <algorithm>
#include <vector>

namespace engine {

namespace {

constexpr int64_t LEAF = 4;  // faces

struct Range {
    int64_t start, end;  // of the order
};

struct KeyedFace {
    double along;
    int64_t face;
};

// Set a node's box, and sort its faces along its longest axis where it is no leaf.
void enter_node(Array<const double, 2> low, Array<const double, 2> high, Array<const double, 2> centre,
                const Range& range, Integers order, Node& node, std::vector<KeyedFace>& keyed) {
    double least[3], most[3];
    for (int x = 0; x < 3; ++x) {
        const int64_t first = order[range.start];
        node.low_m[x] = low(first, x), node.high_m[x] = high(first, x), least[x] = most[x] = centre(first, x);
    }
    for (int64_t i = range.start + 1; i < range.end; ++i)
        for (int x = 0; x < 3; ++x) {
            const int64_t face = order[i];
            node.low_m[x] = std::min(node.low_m[x], low(face, x));
            node.high_m[x] = std::max(node.high_m[x], high(face, x));
            least[x] = std::min(least[x], centre(face, x)), most[x] = std::max(most[x], centre(face, x));
        }
    if (range.end - range.start <= LEAF) return;
    int axis = 0;
    for (int x = 1; x < 3; ++x)
        if (most[x] - least[x] > most[axis] - least[axis]) axis = x;
    keyed.clear();
    for (int64_t i = range.start; i < range.end; ++i) keyed.push_back({centre(order[i], axis), order[i]});
    std::stable_sort(keyed.begin(), keyed.end(),
                     [](const KeyedFace& a, const KeyedFace& b) { return a.along < b.along; });
    for (int64_t i = range.start; i < range.end; ++i) order[i] = keyed[i - range.start].face;
}

}  // namespace

int64_t grow_tree(Array<const double, 2> low, Array<const double, 2> high, Array<const double, 2> centre,
                  Integers order, Array<Node, 1> nodes) {
    for (int64_t i = 0; i < order.size(); ++i) order[i] = i;
    std::vector<KeyedFace> keyed;
    std::vector<Range> level{{0, order.size()}}, next;
    int64_t entered = 0, made = 1;
    while (!level.empty()) {
        next.clear();
        for (const Range& range : level) {
            Node& node = nodes[entered++];
            enter_node(low, high, centre, range, order, node, keyed);
            node.child[0] = -range.start - 1, node.child[1] = range.end;
            if (range.end - range.start <= LEAF) continue;
            node.child[0] = made, node.child[1] = made + 1;
            made += 2;
            const int64_t middle = (range.start + range.end) / 2;
            next.push_back({range.start, middle}), next.push_back({middle, range.end});
        }
        level.swap(next);
    }
    return entered;
}

}  // namespace engine
