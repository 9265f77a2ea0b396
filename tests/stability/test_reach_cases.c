/* SPDX-License-Identifier: MIT */
/* Whole configurations in which the head moves or may go far, a station is far away, or a body moves. Each costs at
 * most half as much again as a head that stands nearby. Cost is counted in leaves that a packet is
 * tested against. No clock is read.
 *
 * A cast that is exact about one origin only is far too slow in each of these. In a house within 1.2 km of ground, a
 * second station 400 m away took 200,000 times as long for a ray. A ball of 960 triangles that moves took 15,000 times
 * as long. */

#include "tests/common/cases.h"
#include "tests/common/reach_cases.h"

enum {
    MOST_TRIANGLES = 100000, /* of a ball; a larger one takes too long to be made */
    MOST_LEAVES = 10 /* for a standing head: a packet has 16 rays, and triangles are wider than two of their gaps */
};

static void count(const struct reach_folder *folder, const struct reach_case *of, struct reach_run *run)
{
    struct sh_err err;
    if (reach_open(folder, of, run, &err) != SH_OK) fail_msg("%s: %s", of->name, err.text);
    for (uint32_t l = 0; l < REACH_LINES; l++)
        reach_cast(run, l);
    print_message("# %-26s %7.3f leaves a packet, %.5f decided a ray, %.1f MB\n", of->name, reach_leaves(run),
                  reach_decided(run), 1e-6 * (double)run->bytes);
}

/* Leaves of the room are 0.25 m large, those of a ball 7 mm or more; rays of a packet are 1 mm apart there. On 1.2 km
 * of ground the boxes of leaves are larger by 0.8 mm (bvh_inside.h). A body's own BVH has no ground, and so may only
 * have fewer. But a packet that passes the ball goes through two BVHs, and lines of a head that moves lie elsewhere.
 * Half as much again is left for that. */
static void costs_as_nearby(void **state)
{
    (void)state;
    static struct reach_run near, run;
    struct reach_folder folder;
    struct sh_err err;
    int stands = -1;
    if (reach_folder_make(&folder, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    for (int i = 0; i < REACH_CASES; i++) {
        const struct reach_case *of = &REACH_CASE[i];
        if (of->ball > MOST_TRIANGLES) continue;
        if (of->standing != stands) {
            reach_close(&near);
            count(&folder, &REACH_CASE[stands = of->standing], &near);
            assert_true(reach_leaves(&near) >= 1.0 && reach_leaves(&near) < MOST_LEAVES);
            assert_true(reach_decided(&near) < 0.001);
        }
        if (i == stands) continue;
        count(&folder, of, &run);
        assert_true(reach_leaves(&run) < 1.5 * reach_leaves(&near));
        assert_true(reach_decided(&run) < 0.001);
        assert_true((double)run.bytes < 1.05 * (double)near.bytes);
        reach_close(&run);
    }
    reach_close(&near);
    reach_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(costs_as_nearby)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
