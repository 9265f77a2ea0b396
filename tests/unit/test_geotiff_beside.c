/* SPDX-License-Identifier: MIT */
/* Rasters side by side: the slit between them is reported, and nothing is where they share cells or lie apart. */
#include "core/import/geotiff/geotiff_beside.h"
#include "tests/common/tif.h"
#include "tests/unit/scene_files.h"

static const double heights[20] = {0};

static char file[2][160];
static const struct sh_report report = {.warn = keep_warning};

/* Writes a raster of 5 x 4 cells of 2 x 3 m, and another one, whose corner is some metres away. */
static void write_pair(double east, double north, double cell_m)
{
    struct tif t = tif_of(5, 4, heights);
    for (int i = 0; i < 2; i++)
        snprintf(file[i], sizeof file[i], "%s/%c.tif", folder, 'a' + i);
    tif_write(file[0], &t);
    t.tie[3] += east;
    t.tie[4] += north;
    t.scale[0] = cell_m;
    tif_write(file[1], &t);
    n_warnings = 0;
    warnings[0] = '\0';
}

/* says: the one warning, or NULL for none. */
static void end_pair(const char *says)
{
    for (int i = 0; i < 2; i++)
        unlink(file[i]);
    if (says == NULL ? n_warnings > 0 : n_warnings != 1 || strstr(warnings, says) == NULL)
        fail_msg("%d: %s", n_warnings, warnings);
}

static void check_pair(double east, double north, double cell_m, double moved_m, const char *says)
{
    const struct scene_mesh_spec spec[2] = {{.file = file[0], .scale = 1},
                                            {.file = file[1], .scale = 1, .offset_m = {moved_m, 0, 0}}};
    write_pair(east, north, cell_m);
    geotiff_warn_beside(spec, 2, &report);
    end_pair(says);
}

static void slits_are_told(void **state)
{
    (void)state;
    static const char columns[] = "a.tif and b.tif lie side by side: terrain ends at the middles of their cells, so "
                                  "pulses pass a slit 2 m wide between them (1 such pair): join the files";
    static const char rows[] = "a slit 3 m wide between them";
    check_pair(10, 0, 2, 0, columns);
    check_pair(-10, 0, 2, 0, columns);
    check_pair(10, -9, 2, 0, columns); /* one row is beside another */
    check_pair(0, 12, 2, 0, rows);
    check_pair(-4, -12, 2, 0, rows);
    check_pair(0, 0, 2, 10, columns); /* the configuration moves it there */
    check_pair(8, 0, 2, 0, NULL);     /* they share a column of cells: the terrain goes on */
    check_pair(0, 9, 2, 0, NULL);
    check_pair(12, 0, 2, 0, NULL);  /* a column is missing between them */
    check_pair(10, 12, 2, 0, NULL); /* only their corners meet */
    check_pair(10, 0, 1, 0, NULL);  /* another grid */
    check_pair(10, 0, 2, -2, NULL);
}

static void a_scene_with_a_slit_is_told(void **state)
{
    (void)state;
    const struct scene_mesh_spec spec[2] = {{.file = file[0], .scale = 1}, {.file = file[1], .scale = 1}};
    struct scene *s;
    struct sh_err err;
    write_pair(10, 0, 2);
    if (scene_load(spec, 2, 1e-3, &report, &s, &err) != SH_OK) fail_msg("%s", err.text);
    scene_free(s);
    end_pair("a.tif and b.tif lie side by side");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slits_are_told),
        cmocka_unit_test(a_scene_with_a_slit_is_told),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
