/* SPDX-License-Identifier: MIT */
#include "tests/unit/killed_e57_rig.h"

struct killed_e57 killed_e57;

static void keep_left(const char *path)
{
    free(killed_e57.left);
    killed_e57.left = rig_read(path, &killed_e57.left_len);
}

void killed_e57_record(bool has_third, bool empty_shots, bool coloured)
{
    static struct rig_point p[40];
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    const int n_lines[] = {6, 1, has_third ? 9 : 1};
    const char *path = rig_path("a.e57");
    rig_begin();
    for (uint32_t scan = 0; scan < 3; scan++) {
        a.station = scan + 1;
        a.anchor[0] += 7;
        rig_descriptor(1, scan + 1);
        rig_anchor(&a);
        for (uint32_t line = 0; line < (uint32_t)n_lines[scan]; line++) {
            for (int i = 0; i < 40; i++)
                p[i] = i % 7 == 3 || (scan == 2 && !has_third)
                           ? (struct rig_point){0, 0, 0, INT16_MIN, 0xffff, 0, 0}
                           : (struct rig_point){i + (int)scan, -i, (int)line, (int16_t)(10 * i - (int)line),
                                                (uint16_t)i,   1,  1};
            rig_points(line, 1100 * line, 1100 * line + line % 3, p, 23 + line);
        }
    }
    const struct colour_choice colour = {.given = coloured, .scale.mode = COLOUR_LABEL};
    killed_rig_record(path, (struct recorder_options){.empty_shots = empty_shots, .colour = colour}, keep_left);
    e57rig_read(path);
    assert_null(strstr(e57rig_xml, KILLED_E57_MISSING));
    free(killed_e57.whole);
    killed_e57.whole = rig_read(path, &killed_e57.whole_len);
    unlink(path);
}

void killed_e57_free(void)
{
    e57rig_free();
    free(killed_e57.whole);
    free(killed_e57.left);
    killed_e57 = (struct killed_e57){0};
}
