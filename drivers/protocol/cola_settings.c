/* SPDX-License-Identifier: MIT */
/* Settings of the measurement that clients write and read. */
#include <stdio.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/cola.h"

void cola_settings_reset(struct cola *self)
{
    const char *name = self->spec.identity->name;
    self->set = (struct cola_settings){.channels = {1, 0},
                                       .rssi = self->model->rssi,
                                       .rssi_16bit = self->model->rssi_16bit,
                                       .every = 1,
                                       .framing = (uint8_t)cola_configured_framing(self)};
    snprintf(self->set.location, sizeof self->set.location, "%s", name[0] != 0 ? name : "not defined");
}

/* ---- LMPoutputRange: u16 1, u32 step, i32 start, i32 stop */

static uint32_t clamped(int64_t beam, const struct planar_head *head)
{
    return beam < 0 ? 0 : beam >= head->n ? head->n - 1 : (uint32_t)beam;
}

/* Computed for each telegram, since the head's step may have changed after the range was written. */
struct cola_beams cola_sent_beams(const struct cola *self, const struct planar_head *head)
{
    if (!self->set.narrowed) return (struct cola_beams){0, head->n};
    const uint32_t first = clamped(cola_beam_at(head, self->set.start_e4), head);
    return (struct cola_beams){first, clamped(cola_beam_at(head, self->set.stop_e4), head) - first + 1};
}

enum cola_error cola_read_output_range(struct cola *self)
{
    const struct planar_head *head = cola_head(self);
    if (!head->known) return COLA_CONDITION;
    const struct cola_beams beams = cola_sent_beams(self, head);
    cola_put_u(&self->out, 2, 1);
    cola_put_u(&self->out, 4, cola_step_angle(head));
    cola_put_i(&self->out, 4, cola_beam_angle(head, beams.first));
    cola_put_i(&self->out, 4, cola_beam_angle(head, beams.first + beams.n - 1));
    return COLA_OK;
}

/* An end between two beams becomes the nearest one, as in the real scanner. */
enum cola_error cola_write_output_range(struct cola *self)
{
    const struct planar_head *head = cola_head(self);
    const uint32_t sectors = self->arg[0], step = self->arg[1];
    const int32_t start_e4 = (int32_t)self->arg[2], stop_e4 = (int32_t)self->arg[3];
    if (!head->known) return COLA_CONDITION;
    if (sectors != 1 || step != cola_step_angle(head) || start_e4 > stop_e4) return COLA_INVALID_DATA;
    const int64_t first = cola_beam_at(head, start_e4), last = cola_beam_at(head, stop_e4);
    if (first < 0 || last >= head->n) return COLA_INVALID_DATA;
    self->set.start_e4 = cola_beam_angle(head, (uint32_t)first);
    self->set.stop_e4 = cola_beam_angle(head, (uint32_t)last);
    self->set.narrowed = 1;
    return COLA_OK;
}

/* ---- LMDscandatacfg: 2 x u8 channels, u8 RSSI, u8 16 bit, u8 unit, 2 x u8 encoder, u8 position, u8 name, u8 comment,
 * u8 time, u16 n: each n-th scan is sent */

void cola_list_cfg(struct cola_settings *s, uint8_t *bytes[COLA_CFG_BYTES])
{
    uint8_t *const list[COLA_CFG_BYTES] = {&s->channels[0], &s->channels[1], &s->rssi,       &s->rssi_16bit,
                                           &s->unit,        &s->encoder[0],  &s->encoder[1], &s->position,
                                           &s->name,        &s->comment,     &s->time};
    memcpy(bytes, list, sizeof list);
}

enum cola_error cola_read_scan_data_cfg(struct cola *self)
{
    uint8_t *bytes[COLA_CFG_BYTES];
    cola_list_cfg(&self->set, bytes);
    for (int i = 0; i < COLA_CFG_BYTES; i++)
        cola_put_u(&self->out, 1, *bytes[i]);
    cola_put_u(&self->out, 2, self->set.every);
    return COLA_OK;
}

int cola_scan_data_fits(const struct cola *self, const struct cola_settings *s)
{
    const uint8_t have = (uint8_t)((1u << self->model->echoes) - 1);
    return s->channels[0] != 0 && (s->channels[0] & ~have) == 0 && s->channels[1] == 0 && s->unit == 0 &&
           s->every != 0 && s->rssi <= 1 && s->rssi_16bit <= 1 && s->position <= 1 && s->name <= 1 && s->comment <= 1 &&
           s->time <= 1;
}

enum cola_error cola_write_scan_data_cfg(struct cola *self)
{
    struct cola_settings s = self->set;
    uint8_t *bytes[COLA_CFG_BYTES];
    cola_list_cfg(&s, bytes);
    for (int i = 0; i < COLA_CFG_BYTES; i++)
        *bytes[i] = (uint8_t)self->arg[i];
    s.every = (uint16_t)self->arg[COLA_CFG_BYTES];
    if (!cola_scan_data_fits(self, &s)) return COLA_INVALID_DATA;
    self->set = s;
    return COLA_OK;
}

/* ---- FREchoFilter: u8 */

enum cola_error cola_read_filter(struct cola *self)
{
    cola_put_u(&self->out, 1, self->set.filter);
    return COLA_OK;
}

int cola_filter_fits(const struct cola *self, uint32_t filter)
{
    return filter <= COLA_ECHOES_LAST && (filter != COLA_ECHOES_ALL || self->model->echoes > 1);
}

enum cola_error cola_write_filter(struct cola *self)
{
    if (!cola_filter_fits(self, self->arg[0])) return COLA_INVALID_DATA;
    self->set.filter = (uint8_t)self->arg[0];
    return COLA_OK;
}

/* ---- LMDscandatascalefactor: float, 1 or 2 */

static float scale_in_use(const struct cola *self)
{
    return (float)(self->set.scale != 0 ? self->set.scale : cola_head_scale(cola_head(self)));
}

enum cola_error cola_read_scale(struct cola *self)
{
    if (!cola_head(self)->known) return COLA_CONDITION;
    cola_put_float(&self->out, scale_in_use(self));
    return COLA_OK;
}

enum cola_error cola_write_scale(struct cola *self)
{
    const float scale = bits_float(self->arg[0]);
    if (!cola_head(self)->known) return COLA_CONDITION;
    /* with 1, ranges over 65.535 m that the head reaches would have no number */
    if (scale != 2.0f && !(scale == 1.0f && cola_head_scale(cola_head(self)) == 1)) return COLA_INVALID_DATA;
    self->set.scale = (uint32_t)scale;
    return COLA_OK;
}
