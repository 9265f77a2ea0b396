/* SPDX-License-Identifier: MIT */
/* An L-shaped room with two stations, and the previews of its head. */
#ifndef TESTS_UNIT_PREVIEW_ROOM_H
#define TESTS_UNIT_PREVIEW_ROOM_H

#include "firmware_sim/app/studio/preview/preview.h"
#include "firmware_sim/site/site.h"

#define ROOM_HEIGHT_M 2.4
#define ROOM_AREA_M2  (2 * (12.0 + 6.0) + 22.0 * 2.4)

/* The faces of a body that stands in the right leg, for room_open_with. */
extern const char ROOM_BODY[];

struct room {
    struct site *site;
    struct coverage *coverage;
    struct preview *preview;
};

/* The head scans all but cones of 50 degrees below and 30 degrees above. tripod: more keys of the first station. */
struct room room_open(const char *tripod);
struct room room_open_with(const char *tripod, const char *body);
void room_close(struct room *r);
/* Asks until there is an answer. The deadline is that of the whole test program. */
int room_ask(struct room *r, const char *path, const char *query, struct web_body *out);
/* The same, and the test fails where it is refused. */
struct web_body room_need(struct room *r, const char *path, const char *query);
/* Returns whether the body of a preview has a cell. */
int room_sees(const struct web_body *b, uint32_t cell);
/* Returns the number behind a key of JSON. */
double room_number(const char *json, const char *key);

#endif
