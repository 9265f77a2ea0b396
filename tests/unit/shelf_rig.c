/* SPDX-License-Identifier: MIT */
#include "tests/unit/shelf_rig.h"

#define IN_TIN(member) offsetof(struct tin, member), sizeof(((struct tin *)0)->member)

const struct cfg_key keys[ROWS] = {
    [HEAD] = {"head", 0, 0, CFG_MAP},
    [HIGH] = {"head.high_m", CFG_MEMBER(struct shelf, high_m), CFG_REAL, "m", "1.5", 0.5, 3},
    [LOCKED] = {"head.locked", CFG_MEMBER(struct shelf, locked), CFG_BOOL, NULL, "on"},
    [TINS] = {"tins", offsetof(struct shelf, tin), sizeof(struct tin), CFG_LIST, NULL, NULL, 1, 4,
              .count_offset = offsetof(struct shelf, n_tins)},
    [TIN] = {"tins[]", 0, 0, CFG_MAP},
    [WEIGHT] = {"tins[].weight_kg", IN_TIN(weight_kg), CFG_REAL, "kg", NULL, 0, 10},
    [NAME] = {"tins[].name", IN_TIN(name), CFG_TEXT, NULL, ""},
    [LABEL] = {"tins[].label", 0, 0, CFG_MAP},
};
const struct cfg_table table = {keys, ROWS};

struct cfg_reader rd;
struct shelf shelf;
struct config_diagnostics found;

int begin(void **state)
{
    (void)state;
    memset(&shelf, 0, sizeof shelf);
    memset(&found, 0, sizeof found);
    cfg_reader_init(&rd, "shelf.yaml", &table, &shelf, &found);
    return 0;
}

void expect_last(const char *text)
{
    assert_true(found.n > 0);
    assert_string_equal(found.err[found.n - 1].text, text);
    assert_int_equal(found.err[found.n - 1].code, SH_EINPUT);
}
