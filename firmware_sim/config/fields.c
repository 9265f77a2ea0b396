/* SPDX-License-Identifier: MIT */
/* Checks the keys of monitored fields against each other, and makes the fields' shapes. */
#include <math.h>
#include <string.h>

#include "drivers/protocol/cola_field.h"
#include "drivers/protocol/cola_model.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/fields.h"
#include "firmware_sim/config/table/given.h"

_Static_assert((int)CONFIG_MAX_FIELDS == (int)COLA_FIELDS, "fields by number");
_Static_assert((int)CONFIG_MAX_INPUTS == (int)COLA_WINDOWS, "inputs");
/* The record of a polygon has the directions of its corners, and both ends of the head's view. */
_Static_assert((int)CONFIG_MAX_POINTS + 2 <= (int)COLA_SHAPE_LINKS, "corners");

/* The keys of each shape. */
static const struct {
    const char *path;
    enum config_field_shape shape;
    int needed;
} owned[] = {{"fields[].points_m", FIELD_POLYGON, 1}, {"fields[].angles_deg", FIELD_SEGMENT, 1},
             {"fields[].radii_m", FIELD_SEGMENT, 1},  {"fields[].corner_m", FIELD_RECTANGLE, 1},
             {"fields[].size_m", FIELD_RECTANGLE, 1}, {"fields[].turn_deg", FIELD_RECTANGLE, 0}};

static void check_keys(struct cfg_reader *rd, const struct config_field *f, uint32_t i)
{
    for (size_t k = 0; k < sizeof owned / sizeof owned[0]; k++) {
        const int given = cfg_is_item_given(rd, owned[k].path, i);
        if (given && owned[k].shape != f->shape)
            cfg_fail_item(rd, owned[k].path, i, "given, but the field is a %s; allowed with shape: %s",
                          cfg_word(rd, "fields[].shape", (int)f->shape),
                          cfg_word(rd, "fields[].shape", (int)owned[k].shape));
        if (!given && owned[k].shape == f->shape && owned[k].needed)
            cfg_fail_item(rd, owned[k].path, i, "missing; required with shape: %s",
                          cfg_word(rd, "fields[].shape", (int)f->shape));
    }
}

/* Twice the area of the triangle of the first corner, corner k and the next, square micrometres. */
static double triangle_um2(const struct config_field *f, uint32_t k)
{
    const double(*at)[2] = f->points_m.at;
    return 1e12 *
           ((at[k][0] - at[0][0]) * (at[k + 1][1] - at[0][1]) - (at[k][1] - at[0][1]) * (at[k + 1][0] - at[0][0]));
}

static void check_polygon(struct cfg_reader *rd, const struct config_field *f, uint32_t i)
{
    const uint32_t n = f->points_m.n;
    double most_um2 = 0.0;
    if (f->shape != FIELD_POLYGON || !cfg_is_item_given(rd, "fields[].points_m", i)) return;
    if (n < 3) cfg_fail_item(rd, "fields[].points_m", i, "%u corners; allowed 3 to %d", n, CONFIG_MAX_POINTS);
    for (uint32_t k = 1; k + 1 < n; k++)
        most_um2 = fmax(most_um2, fabs(triangle_um2(f, k)));
    if (n >= 3 && most_um2 < 1.0)
        cfg_fail_item(rd, "fields[].points_m", i,
                      "its %u corners enclose no area; allowed are corners that do not lie on one line", n);
}

static void check_values(struct cfg_reader *rd, const struct config_field *f, uint32_t i)
{
    const double span_deg = f->angles_deg[1] - f->angles_deg[0];
    check_polygon(rd, f, i);
    if (f->shape == FIELD_SEGMENT && (span_deg < 0.0 || span_deg > 360.0))
        cfg_fail_item(rd, "fields[].angles_deg", i, "%.10g to %.10g; allowed a second angle of 0 to 360 deg more",
                      f->angles_deg[0], f->angles_deg[1]);
    if (f->shape == FIELD_SEGMENT && f->radii_m[0] > f->radii_m[1])
        cfg_fail_item(rd, "fields[].radii_m", i,
                      "%.10g to %.10g; allowed an outer radius that is not below the inner one", f->radii_m[0],
                      f->radii_m[1]);
}

static int make_rectangle(const struct config_field *f, struct cola_field *field)
{
    field->is_rectangle = 1;
    field->turns = f->turn_deg / 360.0;
    for (int i = 0; i < 2; i++) {
        field->corner_um[i] = f->corner_m[i] * 1e6;
        field->size_um[i] = f->size_m[i] * 1e6;
    }
    return cola_shape_rectangle(&field->shape, field->corner_um, field->size_um, field->turns);
}

/* A turned rectangle may reach beyond the limits of its keys. */
static void check_reach(struct cfg_reader *rd, const struct config_field *f, uint32_t i)
{
    struct cola_field made;
    memset(&made, 0, sizeof made);
    if (f->shape != FIELD_RECTANGLE || !cfg_is_item_given(rd, "fields[].size_m", i)) return;
    if (make_rectangle(f, &made) != 0)
        cfg_fail_item(rd, "fields[].size_m", i,
                      "the rectangle reaches farther than x or y of 1000 m; allowed up to that");
}

static void check_number(struct cfg_reader *rd, const struct config *cfg, uint32_t i, const struct cola_model *model)
{
    const uint32_t number = cfg->field[i].number, most = model->n_records;
    for (uint32_t k = 0; k < i; k++)
        if (cfg->field[k].number == number)
            cfg_fail_item(rd, "fields[].number", i, "%u is the number of fields[%u], too; allowed once", number, k);
    if (most != 0 && number > most)
        cfg_fail_item(rd, "fields[].number", i, "%u, but a %s has %u fields; allowed 1 to %u", number,
                      cfg->profile.model, most, most);
    if (cfg_is_item_given(rd, "fields[].output", i) && model->ports != COLA_PORTS_LMS)
        cfg_fail_item(rd, "fields[].output", i,
                      "given, but a %s has an output for each field of a set; allowed with an "
                      "LMS1xx",
                      cfg->profile.model);
}

void cfg_check_fields(struct cfg_reader *rd, const struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_inputs; i++)
        if (cfg->input[i].until_s <= cfg->input[i].from_s && CFG_ITEM_SOUND(rd, i, "inputs[]"))
            cfg_fail_item(rd, "inputs[].until_s", i, "%.10g s, but it begins at %.10g s; allowed a later time",
                          cfg->input[i].until_s, cfg->input[i].from_s);
    if (cfg->n_fields == 0 || cfg->links_are_not_here || !cfg_has_profile(rd)) return; /* fields belong to links */
    const struct cola_model *model = cola_model_find(cfg->profile.model);
    if (model->n_records == 0)
        cfg_fail_key(rd, "fields", "a %s evaluates no fields; allowed with another head.profile", cfg->profile.model);
    for (uint32_t i = 0; i < cfg->n_fields; i++) {
        if (!CFG_ITEM_SOUND(rd, i, "fields[]")) continue;
        check_keys(rd, &cfg->field[i], i);
        check_values(rd, &cfg->field[i], i);
        check_reach(rd, &cfg->field[i], i);
        check_number(rd, cfg, i, model);
    }
}

/* ---- shapes */

static void make_sector(const struct config_field *f, struct cola_shape *shape)
{
    shape->kind = COLA_SHAPE_SECTOR;
    shape->sector.start_e4 = (int32_t)lround(f->angles_deg[0] * 1e4);
    shape->sector.span_e4 = (int32_t)lround((f->angles_deg[1] - f->angles_deg[0]) * 1e4);
    shape->sector.inner_um = (int32_t)lround(f->radii_m[0] * 1e6);
    shape->sector.outer_um = (int32_t)lround(f->radii_m[1] * 1e6);
}

void config_make_field(const struct config_field *from, struct cola_field *out)
{
    memset(out, 0, sizeof *out);
    memcpy(out->name, from->name, sizeof out->name);
    out->response_ms = from->response_ms;
    out->blanking_um = (uint32_t)lround(from->blanking_m * 1e6);
    out->output = (uint8_t)from->output;
    if (from->shape == FIELD_SEGMENT) make_sector(from, &out->shape);
    if (from->shape == FIELD_RECTANGLE) (void)make_rectangle(from, out); /* it was checked */
    for (uint32_t k = 0; k < from->points_m.n; k++)
        cola_shape_add(&out->shape, from->points_m.at[k][0] * 1e6, from->points_m.at[k][1] * 1e6);
}

void config_fill_fields(const struct config *cfg, struct cola_fields *out)
{
    memset(out, 0, sizeof *out);
    for (; out->n_windows < cfg->n_inputs; out->n_windows++) {
        const struct config_input *in = &cfg->input[out->n_windows];
        out->window[out->n_windows] =
            (struct cola_input_window){in->input - 1, llround(in->from_s * 1e9), llround(in->until_s * 1e9)};
    }
    for (uint32_t i = 0; i < cfg->n_fields; i++)
        config_make_field(&cfg->field[i], &out->field[cfg->field[i].number - 1]);
}
