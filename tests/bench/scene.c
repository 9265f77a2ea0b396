/* Where is scanned. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/generate.h"
#include "tests/bench/bench.h"
#include "firmware_sim/base/clock.h"

uint32_t bench_count(const char *name)
{
    char *end;
    if (name[0] < '0' || name[0] > '9') return 0;
    unsigned long n = strtoul(name, &end, 10);
    if (n > 100000000) return 0;
    if (strcmp(end, "k") == 0)
        n *= 1000;
    else if (strcmp(end, "M") == 0)
        n *= 1000000;
    else if (*end != '\0')
        return 0;
    return n >= 100 && n <= 100000000 ? (uint32_t)n : 0;
}

int bench_is_house(const char *name)
{
    return strcmp(name, "house") == 0 || strcmp(name, "garden") == 0;
}

static int load_house(const char *file, const struct sh_report *report, struct bench_target *t, struct sh_err *err)
{
    static const double living_room_m[3] = {5.5, 2.2, 1.6}; /* of config/demo.yaml */
    static const double garden_m[3] = {6.0, -2.6, 1.7};
    struct scene_mesh_spec spec = {.file = file, .up = SCENE_UP_Y, .scale = 1.0};
    memcpy(t->station_m, strcmp(t->name, "garden") == 0 ? garden_m : living_room_m, sizeof t->station_m);
    return scene_load(&spec, 1, 1e-4, report, &t->scene, err);
}

int bench_target_load(const char *name, const char *house, const struct sh_report *report, struct bench_target *out,
                      struct sh_err *err)
{
    static const double centre_m[2] = {0.0, 0.0};
    memset(out, 0, sizeof *out);
    snprintf(out->name, sizeof out->name, "%s", name);
    int64_t start_ns = clock_now_ns();
    int rc;
    if (bench_is_house(name)) {
        rc = load_house(house, report, out, err);
    } else {
        out->station_m[2] = 4.7;
        rc = generate_terrain(bench_count(name), 200.0, 3.0, centre_m, 1, &out->scene, err);
    }
    out->load_s = 1e-9 * (double)(clock_now_ns() - start_ns);
    return rc;
}

void bench_target_free(struct bench_target *target)
{
    scene_free(target->scene);
    target->scene = NULL;
}
