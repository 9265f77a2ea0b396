/* SPDX-License-Identifier: MIT */
#include "tests/wire/room.h"

const double ROOM_MIN[3] = {-4.37, -6.21, -1.53}, ROOM_MAX[3] = {5.83, 3.94, 2.71};

const char *const WALLS[6] = {"west", "east", "south", "north", "floor", "ceiling"};

void room_write(const struct wire *wire)
{
    FILE *f = fopen(wire_path(wire, "room.obj"), "w");
    assert_non_null(f);
    for (int i = 0; i < 8; i++)
        fprintf(f, "v %.17g %.17g %.17g\n", i & 1 ? ROOM_MAX[0] : ROOM_MIN[0], i & 2 ? ROOM_MAX[1] : ROOM_MIN[1],
                i & 4 ? ROOM_MAX[2] : ROOM_MIN[2]);
    static const int quad[6][4] = {{1, 3, 7, 5}, {2, 6, 8, 4}, {1, 5, 6, 2}, {3, 4, 8, 7}, {1, 2, 4, 3}, {5, 7, 8, 6}};
    for (int w = 0; w < 6; w++)
        fprintf(f, "o %s\nusemtl paint-%s\nf %d %d %d %d\n", WALLS[w], WALLS[w], quad[w][0], quad[w][1], quad[w][2],
                quad[w][3]);
    assert_int_equal(fclose(f), 0);
}

void ground_write(const struct wire *wire)
{
    wire_write_text(wire, "room.obj",
                    "v -5000 -5000 -1.7\nv 5000 -5000 -1.7\nv 5000 5000 -1.7\nv -5000 5000 -1.7\n"
                    "o ground\nusemtl grass\nf 1 2 3 4\n");
}

const double STATION[3] = {0.31, -0.42, 0.17}, HEADING_DEG = 30.0;

const char *room_config_write(const struct wire *wire, const struct room_config *c)
{
    const char *path = wire_path(wire, "config.yaml");
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "head:\n  profile: %s\n  prr_hz: %.6f\n  lines_hz: %.6f\n  pan_deg_s: %.6f\n  pan_stop_deg: %.6f\n",
            c->profile != NULL ? c->profile : "full-sweep", c->prr_hz, c->lines_hz, c->pan_deg_s, c->pan_stop_deg);
    if (c->line_start_deg != c->line_stop_deg)
        fprintf(f, "  line_start_deg: %.6f\n  line_stop_deg: %.6f\n", c->line_start_deg, c->line_stop_deg);
    fprintf(f, "  frames: %u\nscene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n", c->frames);
    fprintf(f, "stations:\n  - {position_m: [%.17g, %.17g, %.17g], heading_deg: %.17g}\n", STATION[0], STATION[1],
            STATION[2], HEADING_DEG);
    fprintf(f, "noise: {range: off%s}\n%s%s", c->noise != NULL ? c->noise : "", c->links,
            c->more != NULL ? c->more : "");
    assert_int_equal(fclose(f), 0);
    return path;
}

void room_cast(double mirror_rad, double pan_rad, struct room_ray *ray)
{
    /* SOCS: x right, y forward, z up. The heading turns y clockwise from the scene's y. */
    double turn = pan_rad + HEADING_DEG * M_PI / 180.0;
    double dir[3] = {cos(mirror_rad) * sin(turn), cos(mirror_rad) * cos(turn), sin(mirror_rad)};
    ray->range_m = INFINITY;
    ray->wall = -1;
    for (int w = 0; w < 6; w++) {
        double to = (w & 1 ? ROOM_MAX : ROOM_MIN)[w / 2] - STATION[w / 2];
        double range = to / dir[w / 2];
        ray->plane_m[w] = range > 0.0 ? range : INFINITY;
        if (ray->plane_m[w] >= ray->range_m) continue;
        ray->range_m = ray->plane_m[w];
        ray->wall = w;
    }
}

int64_t micro(double value)
{
    return llround(value * 1e6);
}

struct oracle oracle_of(const struct room_config *c, double fov_min_deg, double fov_max_deg, double sweep_deg)
{
    int window = c->line_start_deg != c->line_stop_deg;
    return (struct oracle){.prr_uhz = micro(c->prr_hz),
                           .lines_uhz = micro(c->lines_hz),
                           .pan_udeg_s = micro(c->pan_deg_s),
                           .pan_stop_udeg = micro(c->pan_stop_deg),
                           .fov_min_udeg = micro(fov_min_deg),
                           .sweep_udeg = micro(sweep_deg),
                           .start_udeg = micro(window ? c->line_start_deg : fov_min_deg),
                           .stop_udeg = micro(window ? c->line_stop_deg : fov_max_deg),
                           .frames = c->frames};
}

static uint64_t ceil_of(i128 a, i128 b)
{
    return (uint64_t)((a + b - 1) / b);
}

uint64_t oracle_line(const struct oracle *o, uint64_t k)
{
    return (uint64_t)((i128)k * o->lines_uhz / o->prr_uhz);
}

uint64_t oracle_first_pulse(const struct oracle *o, uint64_t line)
{
    return ceil_of((i128)line * o->prr_uhz, o->lines_uhz);
}

uint64_t oracle_frame_lines(const struct oracle *o)
{
    return ceil_of((i128)o->pan_stop_udeg * o->lines_uhz, (i128)o->pan_udeg_s * 1000000);
}

uint64_t oracle_end(const struct oracle *o)
{
    return oracle_first_pulse(o, o->frames * oracle_frame_lines(o));
}

int64_t oracle_time_ns(const struct oracle *o, uint64_t k)
{
    return (int64_t)((i128)k * 1000000000000000 / o->prr_uhz);
}

int oracle_is_cast(const struct oracle *o, uint64_t k)
{
    i128 turned = (i128)o->sweep_udeg * (int64_t)((i128)k * o->lines_uhz % o->prr_uhz);
    return turned >= (i128)(o->start_udeg - o->fov_min_udeg) * o->prr_uhz &&
           turned <= (i128)(o->stop_udeg - o->fov_min_udeg) * o->prr_uhz;
}

double oracle_mirror_deg(const struct oracle *o, uint64_t k)
{
    double phase = (double)(int64_t)((i128)k * o->lines_uhz % o->prr_uhz) / (double)o->prr_uhz;
    return 1e-6 * ((double)o->fov_min_udeg + (double)o->sweep_udeg * phase);
}

double oracle_pan_deg(const struct oracle *o, uint64_t k)
{
    uint64_t lines = oracle_frame_lines(o), frame = oracle_line(o, k) / lines;
    uint64_t since = k - oracle_first_pulse(o, frame * lines);
    return 1e-6 * ((double)since * (double)o->pan_udeg_s * 1e6 / (double)o->prr_uhz);
}

uint64_t oracle_count_cast(const struct oracle *o, uint64_t from, uint64_t to)
{
    uint64_t n = 0;
    for (uint64_t k = from; k < to; k++)
        n += (uint64_t)oracle_is_cast(o, k);
    return n;
}
