// @ts-check
// This module reads the description that the server gives of its API. The names that a field can have,
// the defaults of a specification, the functions of the language and the units to read values in come
// from there, so that the page keeps no list of its own.

import { get } from "./api.js";

/** @type {Promise<any> | null} */
let reading = null;

// The description is read once for all views; a failure is forgotten, so that the next view asks again.
/** @returns {Promise<any>} */
export function described() {
  reading ??= get("/openapi.json").then(
    ({ data }) => data,
    (error) => {
      reading = null;
      throw error;
    },
  );
  return reading;
}

// Lists the names that a value of a schema can have.
export const namesIn = (description, schema) => description.components.schemas[schema].enum;

// Lists the names that a parameter of a request can have.
export function namesOfParameter(description, path, method, name) {
  const parameter = description.paths[path][method].parameters.find((entry) => entry.name === name);
  return parameter.schema.enum;
}

// Gives the default of a field, which stands at `path` below a schema.
export function defaultAt(description, schema, path) {
  const { schemas } = description.components;
  let field = schemas[schema];
  for (const name of path) {
    const owner = field?.$ref ? schemas[field.$ref.split("/").at(-1)] : field;
    field = owner?.properties?.[name];
  }
  return field?.default;
}
