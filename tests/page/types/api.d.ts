// What the server answers to a GET, by the address that a module asks: taken from the description of
// the API, of which openapi-typescript makes `openapi.d.ts`.

import type { components, paths } from "openapi";

// `/v1/jobs/{id}/result` as the addresses that it stands for.
type Filled<Path> = Path extends `${infer Before}{${string}}${infer After}` ? `${Before}${string}${Filled<After>}` : Path;
type Asked<Address> = Address extends `${infer Path}?${string}` ? Path : Address;
type Same<One, Other> = [One] extends [Other] ? ([Other] extends [One] ? true : false) : false;

type Json<Operation> = Operation extends { responses: { 200: { content: { "application/json": infer Body } } } } ? Body : any;
type Known<Address> = { [Path in keyof paths]: Same<Filled<Path>, Asked<Address>> extends true ? Json<paths[Path]["get"]> : never }[keyof paths];

// The body of the answer; anything where the address is not known beforehand.
export type Answered<Address extends string> = string extends Address ? any : [Known<Address>] extends [never] ? any : Known<Address>;

export type Schemas = components["schemas"];
