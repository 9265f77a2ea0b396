/* SPDX-License-Identifier: MIT */
/* The tables of keys, and the head profiles, for people: the reference, an example, lists. */
#ifndef FIRMWARE_SIM_CONFIG_REFERENCE_H
#define FIRMWARE_SIM_CONFIG_REFERENCE_H

#include <stddef.h>
#include <stdio.h>

#include "core/err.h"

/* A key as the tables describe it. Strings are constant, except `what`. */
struct config_key_text {
    const char *path, *help;
    const char *const *words; /* the words that it takes, NULL at the end; NULL: its values are no words */
    int has_value;            /* 0: a section, or a list */
    char what[1024];          /* type, unit, allowed values, default, and whether it may be left out */
};
/* The keys of a configuration, or those of a head profile. */
enum config_keys { CONFIG_KEYS, CONFIG_PROFILE_KEYS };
/* Returns the text above these keys in the reference. */
const char *config_keys_intro(enum config_keys keys);
/* Describes key i, in the order of the reference. Returns 0 after the last one. */
int config_describe_key(enum config_keys keys, size_t i, struct config_key_text *out);

/* Prints the reference: every key with type, unit, default, range and help. */
void config_print_reference(FILE *out);

/* Prints the part of the reference for one section ("head", "scene.anchor"), for one key, or for "profile": the keys of
 * head profiles. SH_EINPUT: there is no such section or key; err names the sections. */
int config_print_section(const char *section, FILE *out, struct sh_err *err);

/* Prints a configuration that loads and has all keys, each with its help. Keys that need a value have one; the others
 * are commented out with their defaults. The example names a profile and a mesh that come with the program. */
int config_print_example(FILE *out, struct sh_err *err);

/* Lists the profiles in a directory: name, programs, and how sure their figures are. Returns how many. With dir NULL
 * the function takes the first directory that exists, in the order in which config_load_profile looks for a profile
 * (profile.h). heads/ beside a configuration is not among these directories. */
int config_list_profiles(const char *dir, FILE *out, struct sh_err *err);

#endif
