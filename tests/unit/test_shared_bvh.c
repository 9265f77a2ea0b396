/* One BVH for several stations: none of them loses an echo, and those far from the scene do not share. */
#include <unistd.h>

#include "firmware_sim/site/site.h"
#include "tests/common/hits.h"
#include "tests/unit/cast_rig.h"

/* Small plates one behind the other, 5 cm beside the ray, and a wall. Seen from the BVH's origin all lie in its
 * own plane, nearly: as floats they are so wide that the ray passes each of them. */
enum { PLATES = 100 };

static struct scene *plates(void)
{
    static double v[3 * PLATES + 3][3];
    static uint32_t t[PLATES + 1][3];
    struct scene *scene;
    struct sh_err err;
    for (uint32_t i = 0; i < 3 * (PLATES + 1); i++) {
        uint32_t plate = i / 3, corner = i % 3;
        int wall = plate == PLATES;
        v[i][0] = wall ? 20.0 : 1.0 + 0.1 * plate;
        v[i][1] = wall ? (corner == 1 ? 50.0 : -50.0) : 0.05 + (corner == 1 ? 0.02 : 0.0);
        v[i][2] = wall ? (corner == 2 ? 50.0 : -50.0) : (corner == 2 ? 0.02 : 0.0);
        t[plate][corner] = i;
    }
    if (scene_from_arrays(&(struct scene_arrays){(const double(*)[3])v, 3 * PLATES + 3, (const uint32_t(*)[3])t,
                                                 PLATES + 1, NULL, NULL, 0},
                          &scene, &err) != SH_OK)
        fail_msg("%s", err.text);
    return scene;
}

static void no_number_of_wide_triangles_hides_a_wall(void **state)
{
    (void)state;
    static const double origin[3] = {0, 0, 300}, here[3] = {0, 0, 0};
    const double dx = 1.0, dy = 0.0, dz = 0.0;
    double range_m = 0.0;
    uint32_t triangle = 0;
    struct scene *scene = plates();
    struct caster *caster = NULL;
    struct bvh *bvh = NULL;
    struct sh_err err;
    if (bvh_create(scene, origin, 300.0, 1, NULL, &bvh, &err) != SH_OK || caster_create(&caster, &err) != SH_OK)
        fail_msg("%s", err.text);
    hits_from(caster, bvh, here, 1000.0, 1, &dx, &dy, &dz, &range_m, &triangle);
    assert_int_equal(triangle, PLATES);
    assert_true(fabs(range_m - 20.0) < 1e-9); /* the plane's tilt: 2^-40 of 50 m */
    caster_free(caster);
    bvh_free(bvh);
    scene_free(scene);
}

/* glass_room.obj is 8 m across. */
static void stations_share_within_the_size_of_the_scene(void **state)
{
    (void)state;
    static const struct {
        const char *second;
        uint32_t n_bvh;
    } at[] = {{"[1, 1, 1.6]", 1}, {"[0, 0, 300]", 2}, {"[300, 0, 1.6]", 2}};
    static struct config cfg;
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        char path[] = "/tmp/scanhead-shared-XXXXXX", here[512];
        int fd = mkstemp(path);
        struct site *site;
        struct sh_err err;
        FILE *f = fd < 0 ? NULL : fdopen(fd, "w");
        assert_non_null(f);
        assert_non_null(getcwd(here, sizeof here));
        fprintf(f,
                "head: {profile: riegl-vz400i}\nscene:\n  meshes: [{file: %s/config/scenes/glass_room.obj, up: z, "
                "scale: 1}]\nstations:\n  - {position_m: [0, 0, 1.6]}\n  - {position_m: %s}\n",
                here, at[i].second);
        assert_int_equal(fclose(f), 0);
        int rc = config_load(path, NULL, 0, &cfg, &err);
        if (rc == SH_OK) rc = site_load(&cfg, NULL, &site, &err);
        unlink(path);
        if (rc != SH_OK) fail_msg("%s", err.text);
        assert_int_equal(site->n_bvh, at[i].n_bvh);
        site_free(site);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_number_of_wide_triangles_hides_a_wall),
        cmocka_unit_test(stations_share_within_the_size_of_the_scene),
    };
    return cmocka_run_group_tests_name("shared-bvh", tests, NULL, NULL);
}
