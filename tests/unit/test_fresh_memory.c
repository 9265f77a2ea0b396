/* SPDX-License-Identifier: MIT */
/* New memory may have any content. The C library fills it here before core gets it, so that counters and working memory
 * that nobody sets are seen. */
#include <malloc.h>
#include <math.h>

#include "core/sight.h"
#include "tests/unit/cast_rig.h"

static const struct cast_counters none;

static void working_memory_begins_at_zero(void **state)
{
    (void)state;
    struct caster *caster;
    struct bvh_work *bvh;
    struct sight_work *sight;
    struct cast_counters counters;
    struct sh_err err;
    assert_int_equal(caster_create(&caster, &err), SH_OK);
    caster_get_counters(caster, &counters);
    assert_memory_equal(&counters, &none, sizeof counters);
    caster_free(caster);
    assert_int_equal(bvh_work_create(&bvh, &err), SH_OK);
    assert_true(bvh_work_counters(bvh)->leaves == 0 && bvh_work_counters(bvh)->decided == 0);
    assert_null(bvh_work_profile(bvh));
    bvh_work_free(bvh);
    assert_int_equal(sight_work_create(&sight, &err), SH_OK);
    assert_true(sight_work_counters(sight)->few == 0 && sight_work_counters(sight)->asked == 0);
    sight_work_free(sight);
}

/* A line in a box has the ranges of its walls, to half a count. */
static void a_line_is_cast_with_such_memory(void **state)
{
    (void)state;
    static const double lo[3] = {-4.0, -3.0, -2.0}, hi[3] = {5.0, 6.0, 3.0}, station_m[3] = {0.5, 0.25, 0.125};
    struct cast_rig *rig = cast_rig_open(box_scene(lo, hi), station_m);
    struct schedule_line line;
    struct cast_counters counters;
    const uint32_t n = cast_line(rig, 1, &line);
    assert_int_equal(n, line.cast_end - line.cast0);
    for (uint32_t i = 0; i < n; i++) {
        long double mirror, pan, d[3];
        int wall;
        true_angles(&rig->spec, line.cast0 + i, &mirror, &pan);
        true_direction(mirror, pan, 0.0L, d);
        const double want_m = (double)box_range(lo, hi, station_m, d, &wall);
        assert_int_equal(rig->block.echo[i], 0x11);
        assert_true(fabs(1e-5 * rig->block.a[i] - want_m) < 0.51e-5);
    }
    caster_get_counters(rig->caster, &counters);
    counters.decided = 0; /* rays near an edge of a wall */
    assert_memory_equal(&counters, &none, sizeof counters);
    cast_rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(working_memory_begins_at_zero),
        cmocka_unit_test(a_line_is_cast_with_such_memory),
    };
#ifdef M_PERTURB
    mallopt(M_PERTURB, 0x5a);
#endif
    return cmocka_run_group_tests(tests, NULL, NULL);
}
