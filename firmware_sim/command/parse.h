/* SPDX-License-Identifier: MIT */
/* A line in its parts, how words match patterns, and how replies write numbers and quote parts. */
#ifndef FIRMWARE_SIM_COMMAND_PARSE_H
#define FIRMWARE_SIM_COMMAND_PARSE_H

#include <stddef.h>
#include <stdint.h>

#include "firmware_sim/command/command.h"

enum { COMMAND_FIELD_LEN = 64 };
enum { COMMAND_CLIP_LEN = 36 }; /* length of the part of a line that an error quotes, with its NUL */

/* A line in its parts; header and param point into text. */
struct command_request {
    char text[COMMAND_MAX_LINE + 1];
    const char *header; /* without a leading colon and the '?' */
    size_t header_len;
    int query;
    char *param; /* the rest without blanks around it; "" when there is none */
};

/* Returns 0, or the error number, with its reason in *why. A blank line is no error; its header_len is 0. */
int command_split(const char *line, struct command_request *req, const char **why);

/* Takes the next field of a list, without blanks around it; len is its length, also of one that is cut. Returns what
 * follows its comma, or NULL at the end. */
const char *command_take_field(const char *text, char field[COMMAND_FIELD_LEN], size_t *len);

/* Whether a header matches a pattern of SCPI-99 6.2.1: the upper-case part or the whole of each word, in any
 * case. Words in brackets may be left out. */
int command_header_matches(const char *pattern, const char *header, size_t len);

/* Whether a whole word matches one word of a pattern ("MINimum"). */
int command_word_matches(const char *pattern, const char *word);

/* value * 10^-decimals without superfluous zeros: 300000, -0.5. */
void command_format_fixed(char *buf, size_t len, int64_t value, int decimals);

/* The beginning of text, with "..." where it is cut. */
void command_clip(char clip[COMMAND_CLIP_LEN], const char *text, size_t len);

#endif
