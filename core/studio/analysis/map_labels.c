/* SPDX-License-Identifier: MIT */
/* Places the labels of stations. Each label tries places about its station, the nearest first, and takes the one that
 * costs least. A label may reach into the margins at the map's left, right and upper edge, but not below the map. It
 * must cover no other label and no station, and should cover few walls. */
#include <math.h>

#include "core/studio/analysis/map_inside.h"

enum {
    PLACES = 12, /* about the station, on each ring */
    RINGS = 4,
    ROOM_PX = 4, /* between a station's mark and its label */
};

static void measure(const struct map_station *station, double size[2])
{
    const double name = picture_text_width(&map_name_type, station->name);
    const double height = picture_text_width(&map_height_type, station->height);
    size[0] = fmax(name, height) + 4;
    size[1] = 6;
    if (station->name[0] != '\0') size[1] += map_name_type.size_px;
    if (station->height[0] != '\0') size[1] += map_height_type.size_px;
    if (station->name[0] != '\0' && station->height[0] != '\0') size[1] += 6;
}

/* Returns a box for a label: to the right at first, then left, above, below, and between. Farther rings go round in the
 * same order. */
static struct picture_box box_at(const double at[2], const double size[2], int ring, int place)
{
    static const double direction[PLACES][2] = {{1, 0},       {-1, 0},       {0, -1},     {0, 1},
                                                {1, -1},      {-1, -1},      {1, 1},      {-1, 1},
                                                {0.5, -1.25}, {-0.5, -1.25}, {0.5, 1.25}, {-0.5, 1.25}};
    const double gap = MAP_STATION_PX + ROOM_PX + 26.0 * ring;
    const double x = at[0] + direction[place][0] * (gap + 0.5 * size[0]);
    const double y = at[1] + direction[place][1] * (gap + 0.5 * size[1]);
    return (struct picture_box){x - 0.5 * size[0], y - 0.5 * size[1], x + 0.5 * size[0], y + 0.5 * size[1]};
}

/* Returns whether the box overlaps no label that is placed and no station's mark. Ticks of headings may be covered. A
 * label that covers the tick of its own station costs more (cost_of). */
static int is_free(const struct map *map, const struct map_label *label, uint32_t n, const struct picture_box *box)
{
    for (uint32_t i = 0; i < n; i++) {
        const struct picture_box other = {label[i].left, label[i].top, label[i].right, label[i].bottom};
        if (label[i].placed && picture_box_overlaps(box, &other)) return 0;
    }
    for (uint32_t i = 0; i < map->n_stations; i++) {
        double at[2];
        map_station_place(map, i, at);
        const struct picture_box mark = {at[0] - MAP_STATION_PX, at[1] - MAP_STATION_PX, at[0] + MAP_STATION_PX,
                                         at[1] + MAP_STATION_PX};
        if (picture_box_overlaps(box, &mark)) return 0;
    }
    return 1;
}

/* Returns the share of walls under the box, and a little more where it covers its own station's tick. */
static double cost_of(const struct map *map, const struct map_layout *at, uint32_t station,
                      const struct picture_box *box)
{
    double sum = 0, n = 0, place[2];
    for (double y = box->top; y < box->bottom; y += 2)
        for (double x = box->left; x < box->right; x += 2, n++) {
            const double column = x - at->left, row = at->top + at->map_height - 1 - y;
            if (column >= 0 && row >= 0 && column < at->map_width && row < at->map_height)
                sum += map_structure(map, (uint32_t)column, (uint32_t)row);
        }
    const double heading_rad = map->station[station].heading_rad;
    if (!isnan(heading_rad)) {
        map_station_place(map, station, place);
        const double x = place[0] + MAP_TICK_PX * sin(heading_rad), y = place[1] - MAP_TICK_PX * cos(heading_rad);
        const struct picture_box tip = {x - 3, y - 3, x + 3, y + 3};
        if (picture_box_overlaps(box, &tip)) sum += 0.2 * n;
    }
    return n > 0 ? sum / n : 0;
}

static void place_label(const struct map *map, const struct map_layout *at, uint32_t i, struct map_label *label)
{
    double place[2], size[2], least = INFINITY;
    map_station_place(map, i, place);
    measure(&map->station[i], size);
    for (int ring = 0; ring < RINGS; ring++)
        for (int k = 0; k < PLACES; k++) {
            const double rank = 0.02 * k + 0.5 * ring; /* the next ring costs as much as walls under half of the box */
            if (rank >= least) continue;
            const struct picture_box box = box_at(place, size, ring, k);
            if (box.left < 2 || box.top < 2 || box.right > at->width - 2 || box.bottom > at->top + at->map_height)
                continue;
            const double cost = rank + cost_of(map, at, i, &box);
            if (cost >= least || !is_free(map, label, i, &box)) continue;
            least = cost;
            label[i] = (struct map_label){box.left, box.top, box.right, box.bottom, i, 1};
        }
}

uint32_t map_place_labels(const struct map *map, struct map_label *label)
{
    struct map_layout at;
    uint32_t left_out = 0;
    map_get_layout(map, &at);
    for (uint32_t i = 0; i < map->n_stations; i++) {
        label[i] = (struct map_label){.station = i};
        if (map->station[i].name[0] == '\0' && map->station[i].height[0] == '\0') continue;
        place_label(map, &at, i, label);
        left_out += !label[i].placed;
    }
    return left_out;
}
