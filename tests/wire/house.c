/* SPDX-License-Identifier: MIT */
#include "tests/wire/house.h"

#include "core/scene.h"
#include "tests/common/reference.h"

#define HOUSE "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc"

const double HOUSE_HEADING_DEG = 25.0;

/* This is the station of config/hokuyo.yaml and the other ready configurations. */
static const double STATION_M[3] = {5.5, 2.2, 1.6};

struct house {
    struct scene *scene;
    struct reference *reference;
    uint32_t mark_triangle; /* the first one of the mark */
};

/* A post stands 1 m to the right of the head and 0.4 m before it. The post is 20 cm wide, from the floor to the
 * ceiling. */
static void write_mark(const struct wire *wire)
{
    const double heading = HOUSE_HEADING_DEG * M_PI / 180.0;
    char text[1024];
    size_t used = 0;
    for (int i = 0; i < 8; i++) {
        const double right = (i & 1) ? 1.2 : 1.0, forward = (i & 2) ? 0.6 : 0.4;
        used += (size_t)snprintf(text + used, sizeof text - used, "v %.9f %.9f %.9f\n",
                                 STATION_M[0] + right * cos(heading) + forward * sin(heading),
                                 STATION_M[1] - right * sin(heading) + forward * cos(heading), (i & 4) ? 2.4 : 0.1);
    }
    snprintf(text + used, sizeof text - used, "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n");
    wire_write_text(wire, "mark.obj", text);
}

const char *const *house_options(const struct wire *wire, const char *ptys, const char *const *more)
{
    static char mark[400], heading[64], path[8][400];
    static const char *options[WIRE_MAX_ARGS];
    if (access(HOUSE, R_OK) != 0) {
        print_message("%s is not there: package assimp-testmodels\n", HOUSE);
        skip();
    }
    write_mark(wire);
    snprintf(mark, sizeof mark, "scene.meshes.1.file=%s", wire_path(wire, "mark.obj"));
    snprintf(heading, sizeof heading, "stations.0.heading_deg=%g", HOUSE_HEADING_DEG);
    const char *const sets[] = {mark,
                                "scene.meshes.1.up=z",
                                "scene.meshes.1.scale=1",
                                heading,
                                "noise.range=off",
                                "noise.angle=off",
                                "beam.mode=single",
                                IFC_BY_ASSIMP};
    int n = 0;
    for (size_t i = 0; i < sizeof sets / sizeof sets[0]; i++) {
        options[n++] = "--set";
        options[n++] = sets[i];
    }
    for (int i = 0; ptys[i] != '\0'; i++) {
        char name[16];
        snprintf(name, sizeof name, "pty%c", ptys[i]);
        snprintf(path[i], sizeof path[i], "links.%c.path=%s", ptys[i], wire_path(wire, name));
        options[n++] = "--set";
        options[n++] = path[i];
    }
    while (more != NULL && *more != NULL)
        options[n++] = *more++;
    options[n] = NULL;
    assert_true(n + 6 < WIRE_MAX_ARGS);
    return options;
}

struct house *house_load(const struct wire *wire)
{
    struct house *house = calloc(1, sizeof *house);
    assert_non_null(house);
    char mark[352];
    snprintf(mark, sizeof mark, "%s", wire_path(wire, "mark.obj"));
    struct scene_import_limits limits = scene_import_defaults;
    limits.ifc_reader = IFC_READER_ASSIMP; /* as house_options has it */
    const struct scene_mesh_spec spec[] = {{.file = HOUSE, .up = SCENE_UP_Y, .scale = 1.0, .limits = &limits},
                                           {.file = mark, .up = SCENE_UP_Z, .scale = 1.0}};
    struct sh_err err;
    if (scene_load(spec, 2, 1e-3, NULL, &house->scene, &err) != SH_OK) fail_msg("%s", err.text);
    house->mark_triangle = house->scene->n_triangles - 12;
    house->reference = reference_create((const double(*)[3])house->scene->vertex_m,
                                        (const uint32_t(*)[3])house->scene->triangle, house->scene->n_triangles);
    assert_non_null(house->reference);
    return house;
}

void house_free(struct house *house)
{
    reference_free(house->reference);
    scene_free(house->scene);
    free(house);
}

static struct reference_hit cast(const struct house *house, double azimuth_rad, double elevation_rad)
{
    const double turn = azimuth_rad + HOUSE_HEADING_DEG * M_PI / 180.0;
    const double dir[3] = {sin(turn) * cos(elevation_rad), cos(turn) * cos(elevation_rad), sin(elevation_rad)};
    return reference_cast(house->reference, STATION_M, dir);
}

double house_range_m(const struct house *house, double azimuth_rad, double elevation_rad)
{
    return (double)cast(house, azimuth_rad, elevation_rad).range_m;
}

int house_is_mark(const struct house *house, double azimuth_rad, double elevation_rad)
{
    struct reference_hit hit = cast(house, azimuth_rad, elevation_rad);
    return hit.triangle != REFERENCE_NONE && hit.triangle >= house->mark_triangle;
}

/* Returns the range, or 0 where there is none or the device does not measure it. */
static double within(double range_m, double min_m, double max_m)
{
    return range_m >= min_m && range_m <= max_m ? range_m : 0.0;
}

int house_agrees(const struct house *house, double azimuth_rad, double elevation_rad, double spread_rad, double range_m,
                 double tolerance_m, double min_m, double max_m)
{
    double least_m = INFINITY, most_m = -INFINITY;
    for (int side = -1; side <= 1; side++) {
        double at_m = within(house_range_m(house, azimuth_rad + side * spread_rad, elevation_rad), min_m, max_m);
        if (fabs(range_m - at_m) <= tolerance_m) return 1;
        least_m = fmin(least_m, at_m);
        most_m = fmax(most_m, at_m);
    }
    /* a slanted wall may give any range from one side to the other, an outline (10 cm or more) only those of its two
     * sides */
    return most_m - least_m < 0.1 && range_m >= least_m - tolerance_m && range_m <= most_m + tolerance_m;
}
