/* The scenes of the wire tests, their configurations, and what must come out of them: a closed room whose
 * walls are known planes, and a schedule in exact rational arithmetic that shares nothing with core/schedule.
 */
#ifndef TESTS_WIRE_ROOM_H
#define TESTS_WIRE_ROOM_H

#include <math.h>

#include "tests/wire/wire.h"

__extension__ typedef __int128 i128;

/* ---- the room: scene frame, metres. No two walls at the same distance, no wall at a round one. */
static const double ROOM_MIN[3] = {-4.37, -6.21, -1.53}, ROOM_MAX[3] = {5.83, 3.94, 2.71};
static const char *const WALLS[6] = {"west", "east", "south", "north", "floor", "ceiling"};

/* One object per wall, each of its own material. */
static inline void room_write(const struct wire *wire)
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

/* Open ground 1.7 m below the station: every shot above the horizon is empty. */
static inline void ground_write(const struct wire *wire)
{
    wire_write_text(wire, "room.obj",
                    "v -5000 -5000 -1.7\nv 5000 -5000 -1.7\nv 5000 5000 -1.7\nv -5000 5000 -1.7\n"
                    "o ground\nusemtl grass\nf 1 2 3 4\n");
}

struct room_config {
    const char *profile; /* NULL: full-sweep */
    double prr_hz, lines_hz, pan_deg_s, pan_stop_deg;
    double line_start_deg, line_stop_deg; /* both 0: the profile's */
    unsigned frames;
    const char *links; /* YAML of the list */
    const char *noise; /* noise besides range, ", KEY: VALUE"; NULL: none */
    const char *more;  /* further YAML; NULL: none */
};

#define LINK_YAML_TCP  "links: [{type: tcp, port: 0}]\n"
#define LINK_YAML_PTY  "links: [{type: pty, path: port}]\n"
#define LINK_YAML_BOTH "links: [{type: tcp, port: 0}, {type: pty, path: port}]\n"

static const double STATION[3] = {0.31, -0.42, 0.17}, HEADING_DEG = 30.0;

/* config.yaml in the folder, for room.obj beside it. Its path is good as wire_path says. */
static inline const char *room_config_write(const struct wire *wire, const struct room_config *c)
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

/* ---- the range along a direction given in the head's frame by mirror and pan angle */

struct room_ray {
    double range_m; /* to the nearest wall */
    int wall;
    double plane_m[6]; /* to each wall's plane; infinity behind */
};

static inline void room_cast(double mirror_rad, double pan_rad, struct room_ray *ray)
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

/* ---- the schedule, exactly: everything from k * lines / prr and k / prr in integers */

struct oracle {
    int64_t prr_uhz, lines_uhz, pan_udeg_s, pan_stop_udeg; /* pan from 0 */
    int64_t fov_min_udeg, sweep_udeg, start_udeg, stop_udeg;
    uint32_t frames;
};

static inline int64_t micro(double value)
{
    return llround(value * 1e6);
}

/* fov_min and sweep: the profile's, 240 deg for three facets of a polygon and 100 for full-sweep. */
static inline struct oracle oracle_of(const struct room_config *c, double fov_min_deg, double fov_max_deg,
                                      double sweep_deg)
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

static inline uint64_t ceil_of(i128 a, i128 b)
{
    return (uint64_t)((a + b - 1) / b);
}

static inline uint64_t oracle_line(const struct oracle *o, uint64_t k)
{
    return (uint64_t)((i128)k * o->lines_uhz / o->prr_uhz);
}

static inline uint64_t oracle_first_pulse(const struct oracle *o, uint64_t line)
{
    return ceil_of((i128)line * o->prr_uhz, o->lines_uhz);
}

/* Lines until the pan has gone from 0 to its stop. */
static inline uint64_t oracle_frame_lines(const struct oracle *o)
{
    return ceil_of((i128)o->pan_stop_udeg * o->lines_uhz, (i128)o->pan_udeg_s * 1000000);
}

/* First pulse after the scan's last frame. */
static inline uint64_t oracle_end(const struct oracle *o)
{
    return oracle_first_pulse(o, o->frames * oracle_frame_lines(o));
}

/* floor(k / prr) in ns. */
static inline int64_t oracle_time_ns(const struct oracle *o, uint64_t k)
{
    return (int64_t)((i128)k * 1000000000000000 / o->prr_uhz);
}

/* Whether the mirror is within the cast window: angle * prr_uhz compared in integers. */
static inline int oracle_is_cast(const struct oracle *o, uint64_t k)
{
    i128 turned = (i128)o->sweep_udeg * (int64_t)((i128)k * o->lines_uhz % o->prr_uhz);
    return turned >= (i128)(o->start_udeg - o->fov_min_udeg) * o->prr_uhz &&
           turned <= (i128)(o->stop_udeg - o->fov_min_udeg) * o->prr_uhz;
}

static inline double oracle_mirror_deg(const struct oracle *o, uint64_t k)
{
    double phase = (double)(int64_t)((i128)k * o->lines_uhz % o->prr_uhz) / (double)o->prr_uhz;
    return 1e-6 * ((double)o->fov_min_udeg + (double)o->sweep_udeg * phase);
}

/* The pan starts anew with each frame's first pulse. */
static inline double oracle_pan_deg(const struct oracle *o, uint64_t k)
{
    uint64_t lines = oracle_frame_lines(o), frame = oracle_line(o, k) / lines;
    uint64_t since = k - oracle_first_pulse(o, frame * lines);
    return 1e-6 * ((double)since * (double)o->pan_udeg_s * 1e6 / (double)o->prr_uhz);
}

static inline uint64_t oracle_count_cast(const struct oracle *o, uint64_t from, uint64_t to)
{
    uint64_t n = 0;
    for (uint64_t k = from; k < to; k++)
        n += (uint64_t)oracle_is_cast(o, k);
    return n;
}

#endif
