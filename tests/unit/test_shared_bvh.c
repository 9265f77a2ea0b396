/* One BVH for all stations, however far they are: none of them loses an echo. */
#include <unistd.h>

#include "firmware_sim/site/site.h"
#include "tests/common/hits.h"
#include "tests/unit/cast_rig.h"

/* Plates one behind the other, which pass the ray at 1.4 cm while their boxes hold it, and a wall. */
enum { PLATES = 100 };

static struct scene *plates(void)
{
    static double v[3 * PLATES + 3][3];
    static uint32_t t[PLATES + 1][3];
    struct scene *scene;
    struct sh_err err;
    static const double corner[3][2] = {{-0.03, 0.05}, {0.05, -0.03}, {0.05, 0.05}};
    static const double wall[3][2] = {{-50.0, -50.0}, {50.0, -50.0}, {-50.0, 50.0}};
    for (uint32_t i = 0; i < 3 * (PLATES + 1); i++) {
        const uint32_t plate = i / 3;
        v[i][0] = plate == PLATES ? 20.0 : 1.0 + 0.1 * plate;
        v[i][1] = plate == PLATES ? wall[i % 3][0] : corner[i % 3][0];
        v[i][2] = plate == PLATES ? wall[i % 3][1] : corner[i % 3][1];
        t[plate][i % 3] = i;
    }
    if (scene_from_arrays(&(struct scene_arrays){(const double(*)[3])v, 3 * PLATES + 3, (const uint32_t(*)[3])t,
                                                 PLATES + 1, NULL, NULL, 0},
                          &scene, &err) != SH_OK)
        fail_msg("%s", err.text);
    return scene;
}

/* From the scene, and from far away. 1e-9 m: 16 x 2^-53 of 30 km is 5e-11 m (test_range). */
static void no_number_of_plates_hides_a_wall(void **state)
{
    (void)state;
    static const double back_m[] = {0.0, 300.0, 30000.0};
    const double dx = 1.0, dy = 0.0, dz = 0.0;
    struct scene *scene = plates();
    struct caster *caster = NULL;
    struct bvh *bvh = NULL;
    struct sh_err err;
    if (bvh_create(scene, 1, NULL, &bvh, &err) != SH_OK || caster_create(&caster, &err) != SH_OK)
        fail_msg("%s", err.text);
    for (size_t i = 0; i < sizeof back_m / sizeof *back_m; i++) {
        const double here[3] = {-back_m[i], 0, 0};
        double range_m = 0.0;
        uint32_t triangle = 0;
        hits_from(caster, bvh, here, 1e5, 1, &dx, &dy, &dz, &range_m, &triangle);
        assert_int_equal(triangle, PLATES);
        assert_true(fabs(range_m - 20.0 - back_m[i]) < 1e-9);
    }
    caster_free(caster);
    bvh_free(bvh);
    scene_free(scene);
}

/* glass_room.obj is 8 m across. */
static void stations_share_wherever_they_are(void **state)
{
    (void)state;
    static const char *const second[] = {"[1, 1, 1.6]", "[0, 0, 300]", "[30000, 0, 1.6]"};
    static struct config cfg;
    for (size_t i = 0; i < sizeof second / sizeof *second; i++) {
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
                here, second[i]);
        assert_int_equal(fclose(f), 0);
        int rc = config_load(path, NULL, 0, &cfg, &err);
        if (rc == SH_OK) rc = site_load(&cfg, NULL, &site, &err);
        unlink(path);
        if (rc != SH_OK) fail_msg("%s", err.text);
        assert_non_null(site->bvh);
        for (uint32_t k = 0; k < 2; k++)
            assert_ptr_equal(site->station[k].bvh, site->bvh);
        site_free(site);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_number_of_plates_hides_a_wall),
        cmocka_unit_test(stations_share_wherever_they_are),
    };
    return cmocka_run_group_tests_name("shared-bvh", tests, NULL, NULL);
}
