/* SPDX-License-Identifier: MIT */
/* The error queue and its texts. */
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/error_queue.h"

#include <stdio.h>
#include <string.h>

static const struct {
    int number;
    const char *text;
} error_texts[] = {
    {CMD_E_NONE, "No error"},
    {CMD_E_SYNTAX, "Syntax error"},
    {CMD_E_DATA_TYPE, "Data type error"},
    {CMD_E_NOT_ALLOWED, "Parameter not allowed"},
    {CMD_E_MISSING, "Missing parameter"},
    {CMD_E_HEADER, "Undefined header"},
    {CMD_E_SUFFIX, "Invalid suffix"},
    {CMD_E_PROTECTED, "Command protected"},
    {CMD_E_SETTINGS, "Settings conflict"},
    {CMD_E_RANGE, "Data out of range"},
    {CMD_E_SELF_TEST, "Self-test failed"},
    {CMD_E_QUEUE, "Queue overflow"},
    {CMD_E_OVERRUN, "Input buffer overrun"},
    {CMD_E_CLIENT_LOST, "Client lost"},
    {CMD_E_READER, "Reader too slow"},
    {CMD_E_PULSES, "Pulses lost"},
    {CMD_E_REFUSED, "Client refused"},
    {CMD_E_PARTIAL, "Incomplete command"},
    {CMD_E_LINES, "Lines lost"},
    {CMD_E_TIME, "Time server"},
};

const char *command_error_text(int number)
{
    for (size_t i = 0; i < sizeof error_texts / sizeof error_texts[0]; i++)
        if (error_texts[i].number == number) return error_texts[i].text;
    /* The generic text of the number's class, SCPI-99 21.8.3. */
    if (number <= -100 && number > -200) return "Command error";
    if (number <= -200 && number > -300) return "Execution error";
    if (number <= -400 && number > -500) return "Query error";
    return "Device-specific error";
}

void command_error_compose(char *buf, size_t len, int number, const char *text)
{
    const int has_text = text != NULL && text[0] != '\0';
    const int whole =
        snprintf(buf, len, "%s%s%s", command_error_text(number), has_text ? "; " : "", has_text ? text : "");
    if (whole >= (int)len) memcpy(buf + len - 4, "...", 3);
    for (char *p = buf; *p != '\0'; p++) {
        if (*p == '"') *p = '\'';
        if (*p < 0x20 || *p > 0x7e) *p = '~';
    }
}

void command_queue_push(struct command_queue *queue, int number, const char *text)
{
    if (queue->count < COMMAND_QUEUE_LEN) {
        const uint32_t at = (queue->first + queue->count++) % COMMAND_QUEUE_LEN;
        queue->entry[at].number = number;
        command_error_compose(queue->entry[at].text, sizeof queue->entry[at].text, number, text);
        return;
    }
    const uint32_t last = (queue->first + queue->count - 1) % COMMAND_QUEUE_LEN;
    /* The first time two errors are lost: the one in the last place, and the new one. */
    queue->overflow = queue->entry[last].number == CMD_E_QUEUE ? queue->overflow + 1 : 2;
    queue->entry[last].number = CMD_E_QUEUE;
    char lost[40];
    snprintf(lost, sizeof lost, "%u errors lost", queue->overflow);
    command_error_compose(queue->entry[last].text, sizeof queue->entry[last].text, CMD_E_QUEUE, lost);
}

void command_queue_pop(struct command_queue *queue, char *buf, size_t len)
{
    if (queue->count == 0) {
        snprintf(buf, len, "0,\"%s\"", command_error_text(CMD_E_NONE));
        return;
    }
    snprintf(buf, len, "%d,\"%s\"", queue->entry[queue->first].number, queue->entry[queue->first].text);
    queue->first = (queue->first + 1) % COMMAND_QUEUE_LEN;
    if (--queue->count == 0) queue->overflow = 0;
}
